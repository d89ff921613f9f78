"""Neighbors of points, their spacing, and where they end."""
