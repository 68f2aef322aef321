"""Measures of meshes: quality, and the distance between two surfaces."""
