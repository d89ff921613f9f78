"""Volumes: one file a format, each to voxels in canonical order with their affine, LPS millimeters."""
