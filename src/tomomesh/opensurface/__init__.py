"""Surfaces that do not close: where they end, and a sheet with borders along there.

*Chosen* numbers are neither derived nor tuned: by how much half and twice of each change the mean distance of made
surfaces to their truth is measured by ``benchmarks/constants.py``, and said with each.
"""
