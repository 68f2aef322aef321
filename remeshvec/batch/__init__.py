"""The pipeline for a file with its data, and for many meshes."""
