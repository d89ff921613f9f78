"""Springs, squares, and projections onto the surface under samples."""
