"""Triangles, lines and dots on a grid of pixels."""
