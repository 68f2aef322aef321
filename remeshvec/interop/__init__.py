"""Mesh objects of other libraries, with their data."""
