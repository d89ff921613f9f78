"""The self-organising map itself: inputs -> codebook."""
