"""GIFTI surfaces, through nibabel: RAS millimeters, as every program of neuroimaging takes them."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ..colors import named_colors
from ..files.atomic import replacing
from ..volumes.nifti_frame import FLIP
from .attributes import MM, single_precision

if TYPE_CHECKING:
    from pathlib import Path

    from numpy.typing import NDArray

    from ...model.mesh import TriMesh
    from ..fields import Fields
    from .attributes import MeshAttributes

SCANNER, UNKNOWN = "NIFTI_XFORM_SCANNER_ANAT", "NIFTI_XFORM_UNKNOWN"


def write_gifti(mesh: TriMesh, path: str | Path, beside: MeshAttributes) -> None:
    """Write 32-bit coordinates in millimeters, RAS where the mesh has a patient frame, and the fields at vertices.

    The array of positions says which: ``NIFTI_XFORM_SCANNER_ANAT``, else ``NIFTI_XFORM_UNKNOWN``. No other array has a
    frame (GIFTI 1.0, 2.3.4), though nibabel gives one to each; ITK and gifti_tool complain of them.

    Raises
    ------
    OutputError
        Where 32 bits cannot keep the vertices apart.
    """
    from nibabel.gifti import GiftiCoordSystem, GiftiDataArray, GiftiImage, GiftiMetaData

    placed, patient = _ras(mesh.vertices, beside)
    space = SCANNER if patient else UNKNOWN
    points = GiftiDataArray(
        single_precision(placed, path, kind="GIFTI"),
        intent="NIFTI_INTENT_POINTSET",
        datatype="NIFTI_TYPE_FLOAT32",
        coordsys=GiftiCoordSystem(space, space, np.eye(4)),
        meta=GiftiMetaData(written_by=beside.head, coordinates="RAS, mm" if patient else beside.unit),
    )
    others = [GiftiDataArray(mesh.faces.astype(np.int32), "NIFTI_INTENT_TRIANGLE", "NIFTI_TYPE_INT32")]
    others += [
        GiftiDataArray(values, intent, "NIFTI_TYPE_FLOAT32", meta=GiftiMetaData(Name=name))
        for name, intent, values in _arrays(beside.vertex_fields)
    ]
    for array in others:
        array.coordsys = None
    image = GiftiImage(darrays=[points, *others], meta=GiftiMetaData(Description=beside.head))
    with replacing(path) as file:
        file.write(image.to_xml())


def _ras(vertices: NDArray[np.float64], beside: MeshAttributes) -> tuple[NDArray[np.float64], bool]:
    """Return the positions in millimeters, RAS, and whether the frame is a patient's."""
    placed = vertices * MM.get(beside.unit, 1.0)
    if beside.frame == "LPS":
        placed = placed * np.diag(FLIP)[:3]
    return placed, beside.frame in ("LPS", "RAS") and beside.unit in MM


def _arrays(fields: Fields) -> list[tuple[str, str, NDArray[np.float32]]]:
    """Return name, intent and values; the three colors are one array of fractions."""
    colors = named_colors(fields)
    others = {name: values for name, values in fields.items() if not colors or name not in colors[0]}
    found = [("color", "NIFTI_INTENT_RGB_VECTOR", (colors[1] / 255).astype(np.float32))] if colors else []
    return found + [(name, "NIFTI_INTENT_NONE", values.astype(np.float32)) for name, values in others.items()]
