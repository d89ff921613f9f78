"""What pictures are made of: a page, its panels, marks, axes, letters and surfaces."""
