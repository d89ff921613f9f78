"""Files in, files out: the border where every frame becomes LPS millimeters.

One file a format, in `volumes`, `meshes`, `clouds` and `dicom`; a table leads from each suffix to its reader or writer.
`studies` finds what a path leads to, `files` guards and finishes files as such.
"""

from __future__ import annotations

from .clouds.read import POINT_READERS, read_points
from .clouds.write import POINT_WRITERS, write_points
from .dicom import Listing, Series
from .documents import read_settings, write_document, write_settings, write_table
from .files.atomic import check_output, replacing
from .frames import LENGTHS, RAS_ALONE, Frame, frame_in_file, frame_of_study, in_lps
from .meshes.encapsulated import ARCHIVED, check_archived, is_archived, write_encapsulated
from .meshes.frame import frame_of_file
from .meshes.pieces.files import write_pieces
from .meshes.pieces.neuroglancer import write_neuroglancer
from .meshes.read import MESH_READERS, read_mesh
from .meshes.write import MESH_WRITERS, PART_WRITERS, keeps, write_mesh
from .studies.folder import Study, files_of, find_studies
from .studies.label_names import label_names
from .studies.label_tables import read_label_names
from .studies.listing import list_series
from .studies.read import VOLUME_READERS, open_study, read_volume
from .studies.size import voxel_bytes
from .volumes.images import read_picture
from .volumes.labels import LABEL_WRITERS, write_labels

__all__ = [
    "ARCHIVED",
    "LABEL_WRITERS",
    "LENGTHS",
    "MESH_READERS",
    "MESH_WRITERS",
    "PART_WRITERS",
    "POINT_READERS",
    "POINT_WRITERS",
    "RAS_ALONE",
    "VOLUME_READERS",
    "Frame",
    "Listing",
    "Series",
    "Study",
    "check_archived",
    "check_output",
    "files_of",
    "find_studies",
    "frame_in_file",
    "frame_of_file",
    "frame_of_study",
    "in_lps",
    "is_archived",
    "keeps",
    "label_names",
    "list_series",
    "open_study",
    "read_label_names",
    "read_mesh",
    "read_picture",
    "read_points",
    "read_settings",
    "read_volume",
    "replacing",
    "voxel_bytes",
    "write_document",
    "write_encapsulated",
    "write_labels",
    "write_mesh",
    "write_neuroglancer",
    "write_pieces",
    "write_points",
    "write_settings",
    "write_table",
]
