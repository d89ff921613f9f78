"""Voxels and the cells between them."""
