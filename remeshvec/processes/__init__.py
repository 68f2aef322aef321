"""Worker processes that do one task after another, here or behind a client of a cluster."""
