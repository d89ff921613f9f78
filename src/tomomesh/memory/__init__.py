"""A limit on the memory of a run: what of NumPy's arrays is beyond it lies in files, and all else stays as it is."""
