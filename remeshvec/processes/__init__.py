"""Worker processes that do one task after another, and survive each other's deaths."""
