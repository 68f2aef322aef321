"""Worker processes that do one task after another."""
