"""The boundary of a window's own voxels, where gray levels cross its bounds."""
