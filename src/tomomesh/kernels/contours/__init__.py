"""Kernels of contours: rings drawn onto pixels."""
