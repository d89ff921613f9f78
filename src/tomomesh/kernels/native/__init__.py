"""Kernels as machine code: made by Numba once, kept in a cache, loaded and called without Numba ever after."""
