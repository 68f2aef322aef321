"""Isotropic remeshing of triangle meshes."""
