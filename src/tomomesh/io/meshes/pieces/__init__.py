"""Meshes that need not be whole: handed to writers part by part, as several files, and as levels of detail."""
