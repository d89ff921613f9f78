"""Clouds of points: one file a format family, and the tables of what reads and writes each suffix."""
