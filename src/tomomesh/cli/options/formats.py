"""The formats that the help names: those of the tables of `io`, which are not imported here."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Sequence

MESH_FORMATS = ("stl", "ply", "obj", "off", "glb", "vtp", "3mf", "gii", "surf.gii")
STUDY_MESH_FORMATS = (*MESH_FORMATS, "dcm")
"""Meshes of a study: DICOM Encapsulated STL too."""
POINT_FORMATS = ("ply", "xyz", "csv", "npy", "vtp")
LABEL_FORMATS = ("nii", "nii.gz")
CHECKED_FORMATS = ("stl", "ply", "obj", "off", "vtp", "3mf", "glb", "gii", "dcm")
CLOUD_FORMATS = (
    "ply", "xyz", "txt", "csv", "tsv", "npy", "npz", "pcd", "las", "laz", "e57", "obj", "off", "stl", "3mf", "glb",
    "gii", "vtp", "asc", "xyzn", "xyzrgb", "pts", "ptx",
)  # fmt: skip
TILE_FORMATS = ("las", "laz")
"""Files of a folder that together are one cloud."""
STUDY_FORMATS = ("nii", "nii.gz", "nrrd", "mha", "mgh", "mgz", "npy", "tif", "tiff", "dcm", "ima", "zip", "ozx")
"""Single files that hold a whole study."""
HEADER_FORMATS = ("nhdr", "mhd", "hdr", "hdr.gz", "img", "img.gz")
"""Studies whose header and voxels lie in two files."""
TEXTS = ("obj", "off", "xyz", "csv")
"""Formats that a terminal can show."""


def either(formats: Sequence[str]) -> str:
    """Put suffixes into words."""
    *others, last = (f".{name}" for name in formats)
    return f"{', '.join(others)} or {last}" if others else last


MESH, STUDY_MESH, POINT, LABEL, CHECKED = map(
    either, (MESH_FORMATS, STUDY_MESH_FORMATS, POINT_FORMATS, LABEL_FORMATS, CHECKED_FORMATS)
)
STUDY = (
    f"a file ({either(STUDY_FORMATS + HEADER_FORMATS)}), a folder of DICOM slices or of OME-Zarr, "
    "or a folder of PNG, TIFF or JPEG slices (with --spacing)"
)
CLOUD = (
    f"an unoriented cloud ({either(CLOUD_FORMATS)}); of meshes the vertices, of a DICOM RT Structure Set the contours; "
    f"or a folder of tiles ({either(TILE_FORMATS)})"
)
