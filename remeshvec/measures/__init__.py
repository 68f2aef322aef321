"""Numbers about meshes: quality, and the distance of two surfaces."""
