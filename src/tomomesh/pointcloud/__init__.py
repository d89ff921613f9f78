"""What is known of points from their positions alone: neighbors, spacing, noise, holes.

*Chosen* numbers are neither derived nor tuned: by how much half and twice of each change the mean distance of made
surfaces to their truth is measured by ``benchmarks/constants.py``, and said with each.
"""
