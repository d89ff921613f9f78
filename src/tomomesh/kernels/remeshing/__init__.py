"""Loops over a mesh whose triangles are made even."""
