"""Series of slices: listed, chosen, checked, put in order, and read as gray levels."""
