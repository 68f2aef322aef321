"""Mesh files: guarded, read, and written whole or not at all."""
