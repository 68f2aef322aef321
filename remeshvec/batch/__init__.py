"""Remeshing of a file with its data, and of many meshes."""
