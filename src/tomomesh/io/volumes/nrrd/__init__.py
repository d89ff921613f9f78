"""NRRD: the header, the frame, and the segments that Slicer names in it."""
