"""OME-Zarr: the image, its frame, and arrays whose chunks are checked one by one."""
