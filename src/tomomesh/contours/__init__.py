"""Stacks of contours: their slices, their rings, their insides, and the shape between them."""
