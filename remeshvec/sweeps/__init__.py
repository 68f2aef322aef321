"""The loop over the operations, and the finish after the last sweep."""
