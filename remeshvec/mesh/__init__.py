"""The half-edge mesh on flat arrays: connect, clean, orient, order, and cut into blocks."""
