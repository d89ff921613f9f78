"""Headers of DICOM files: read within bounds, and what they say of each frame."""
