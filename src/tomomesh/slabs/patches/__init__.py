"""A mesh that is never whole: its patches, a slab's faces each, checked, measured and written one after the other."""
