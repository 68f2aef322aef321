"""Shapes made by code: for the meshes of this folder, for tests, benchmarks and pictures."""
