"""Mesh files: checked before they are read, and written completely or not at all."""
