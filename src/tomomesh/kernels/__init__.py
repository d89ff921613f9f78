"""Compiled loops: arrays in, arrays out, no checks. The only place that imports numba."""
