"""Surfaces that do not close: where they end, and a sheet with borders along there."""
