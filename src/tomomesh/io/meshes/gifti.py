"""GIFTI surfaces, through nibabel: RAS millimeters, as every program of neuroimaging takes them."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from ...errors import FormatError
from ...model.units import MM
from ..colors import named_colors
from ..files.atomic import replacing
from ..files.source import third_party
from ..frames import frame_in_file
from .attributes import single_precision

if TYPE_CHECKING:
    from pathlib import Path

    from numpy.typing import NDArray

    from ...model.mesh import TriMesh
    from ..fields import Fields
    from .attributes import MeshAttributes
    from .cells import Arrays

SCANNER, UNKNOWN = "NIFTI_XFORM_SCANNER_ANAT", "NIFTI_XFORM_UNKNOWN"


SURFACE = ".surf.gii"
"""Ending of a surface for Connectome Workbench, which opens none that holds more than positions and triangles."""


def is_bare(path: str | Path) -> bool:
    """Whether a file holds positions and triangles alone by its ending, and no fields."""
    return str(path).lower().endswith(SURFACE)


def write_gifti(mesh: TriMesh, path: str | Path, beside: MeshAttributes) -> None:
    """Write 32-bit coordinates in millimeters, RAS where the mesh has a patient frame, and the fields at vertices.

    A ``.surf.gii`` has no fields: Connectome Workbench would not open it.

    The array of positions says which: ``NIFTI_XFORM_SCANNER_ANAT``, else ``NIFTI_XFORM_UNKNOWN``. No other array has a
    frame (GIFTI 1.0, 2.3.4), though nibabel gives one to each; ITK and gifti_tool complain of them.

    Raises
    ------
    OutputError
        Where 32 bits cannot keep the vertices apart.
    """
    from nibabel.gifti import GiftiCoordSystem, GiftiDataArray, GiftiImage, GiftiMetaData

    frame = frame_in_file(path, unit=beside.unit, frame=beside.frame)
    patient = (frame.unit, frame.name) == ("mm", "RAS")
    space, head = SCANNER if patient else UNKNOWN, replace(beside, unit=frame.unit, frame=frame.name).head
    points = GiftiDataArray(
        single_precision(frame.place(mesh.vertices), path, kind="GIFTI"),
        intent="NIFTI_INTENT_POINTSET",
        datatype="NIFTI_TYPE_FLOAT32",
        coordsys=GiftiCoordSystem(space, space, np.eye(4)),
        meta=GiftiMetaData(written_by=head, coordinates="RAS, mm" if patient else frame.unit),
    )
    others = [GiftiDataArray(mesh.faces.astype(np.int32), "NIFTI_INTENT_TRIANGLE", "NIFTI_TYPE_INT32")]
    others += [
        GiftiDataArray(values, intent, "NIFTI_TYPE_FLOAT32", meta=GiftiMetaData(Name=name))
        for name, intent, values in _arrays({} if is_bare(path) else beside.vertex_fields)
    ]
    for array in others:
        array.coordsys = None
    image = GiftiImage(darrays=[points, *others], meta=GiftiMetaData(Description=head))
    with replacing(path) as file:
        file.write(image.to_xml())


def _arrays(fields: Fields) -> list[tuple[str, str, NDArray[np.float32]]]:
    """Return name, intent and values; the three colors are one array of fractions."""
    colors = named_colors(fields)
    others = {name: values for name, values in fields.items() if not colors or name not in colors[0]}
    found = [(name, "NIFTI_INTENT_NONE", values.astype(np.float32)) for name, values in others.items()]
    # last: niivue takes all that follows the triangles for the frames of one overlay, of which it shows the first
    return found + ([("color", "NIFTI_INTENT_RGB_VECTOR", (colors[1] / 255).astype(np.float32))] if colors else [])


def read_gifti(data: bytes, file: str) -> Arrays:
    """Read the vertices and faces of a surface, in its own millimeters; positions are not moved by its matrix.

    Raises
    ------
    FormatError
    """
    from nibabel.gifti import GiftiImage

    with third_party("nibabel", file):
        image = GiftiImage.from_bytes(data)
        points, faces = (
            image.get_arrays_from_intent(name) for name in ("NIFTI_INTENT_POINTSET", "NIFTI_INTENT_TRIANGLE")
        )
        if len(points) != 1 or len(faces) != 1:
            raise FormatError("the file is no surface", file=file, expected="one array of points, one of triangles")
        return np.array(points[0].data, np.float64).reshape(-1, 3), np.array(faces[0].data, np.int64).reshape(-1, 3)


def gifti_frame(data: bytes, file: str) -> dict[str, str]:
    """Return the unit and the frame: RAS millimeters, but where tomomesh wrote it of another frame."""
    from nibabel.gifti import GiftiImage

    with third_party("nibabel", file):
        image = GiftiImage.from_bytes(data)
        written = image.meta.get("Description") or ""
    named = dict(word.split("=", 1) for word in written.split() if "=" in word) if "tomomesh" in written else {}
    unit = "mm" if named.get("unit", "mm") in MM else named["unit"]
    frame = named.get("frame", "RAS")
    return {"unit": unit, "frame": "RAS" if frame in ("LPS", "RAS") else frame}
