"""Pixels of DICOM frames: found, decoded in a process of their own, and brought to gray levels or colors."""
