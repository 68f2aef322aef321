"""Mesh objects of other libraries, with the data they carry."""
