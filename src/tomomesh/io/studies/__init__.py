"""Studies: the volume, the slices or the series behind a path, whatever holds them."""
