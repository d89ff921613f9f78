"""Files in, files out: the border where every frame becomes LPS millimeters.

One file a format family; each table leads from a suffix to a reader or a writer.
"""

from __future__ import annotations

from .atomic import check_output, replacing
from .dicom import Listing, Series
from .documents import read_settings, write_document, write_settings, write_table
from .frames import Frame, frame_of_study
from .images import read_picture
from .labels import LABEL_WRITERS, write_labels
from .meshes import MESH_READERS, MESH_WRITERS, keeps, read_mesh, write_mesh
from .points import POINT_READERS, POINT_WRITERS, read_points, write_points
from .series import list_series
from .stated import stated
from .studies import Study, find_studies
from .volumes import VOLUME_READERS, read_volume

__all__ = [
    "LABEL_WRITERS",
    "MESH_READERS",
    "MESH_WRITERS",
    "POINT_READERS",
    "POINT_WRITERS",
    "VOLUME_READERS",
    "Frame",
    "Listing",
    "Series",
    "Study",
    "check_output",
    "find_studies",
    "frame_of_study",
    "keeps",
    "list_series",
    "read_mesh",
    "read_picture",
    "read_points",
    "read_settings",
    "read_volume",
    "replacing",
    "stated",
    "write_document",
    "write_labels",
    "write_mesh",
    "write_points",
    "write_settings",
    "write_table",
]
