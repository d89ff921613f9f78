"""One volume as slabs of slices, worked on one by one or side by side: the same bytes as in memory."""
