"""A target edge length at every vertex."""
