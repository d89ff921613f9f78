"""Cubes as rising keys, and as bits."""
