"""DICOM objects that hold no image: segmentations, and structure sets of contours."""
