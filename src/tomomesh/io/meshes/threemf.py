"""3MF: the zip of XML that slicers for 3D printing read.

In millimeters always: Slic3r, OpenSCAD and assimp pass over the unit that a model names.

Written with the standard library: it is one text in a zip with two fixed companions. trimesh's exporter stamps the time
and random ids into the file, and lib3mf is a compiled library; it judges what is written here in the tests.
"""

from __future__ import annotations

import zipfile
from dataclasses import replace
from typing import TYPE_CHECKING
from xml.sax.saxutils import quoteattr

import numpy as np

from ...errors import OutputError
from ..colors import named_colors
from ..files.atomic import replacing
from .attributes import MM

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path

    from ...model.mesh import TriMesh
    from .attributes import MeshAttributes

CORE = "http://schemas.microsoft.com/3dmanufacturing/core/2015/02"
MATERIAL = "http://schemas.microsoft.com/3dmanufacturing/material/2015/02"
PACKAGE = "http://schemas.openxmlformats.org/package/2006"
MODEL_TYPE = "application/vnd.ms-package.3dmanufacturing-3dmodel+xml"

DECLARATION = '<?xml version="1.0" encoding="UTF-8"?>\n'

COMPANIONS = {
    "[Content_Types].xml": f'{DECLARATION}<Types xmlns="{PACKAGE}/content-types">'
    '<Default Extension="rels" ContentType="application/vnd.openxmlformats-package.relationships+xml"/>'
    f'<Default Extension="model" ContentType="{MODEL_TYPE}"/></Types>\n',
    "_rels/.rels": f'{DECLARATION}<Relationships xmlns="{PACKAGE}/relationships">'
    '<Relationship Target="/3D/3dmodel.model" Id="rel0" '
    'Type="http://schemas.microsoft.com/3dmanufacturing/2013/01/3dmodel"/></Relationships>\n',
}
"""Member of the zip to its text: what kinds of parts there are, and which is the model."""

FIRST_DAY = (1980, 1, 1, 0, 0, 0)
"""The date of every member, so that the bytes repeat; a zip knows none before."""

COLORS_ID, MESH_ID = 1, 2
"""Numbers of the two resources of a file; any will do."""


def write_3mf(mesh: TriMesh, path: str | Path, beside: MeshAttributes) -> None:
    """Write one object of 64-bit coordinates in millimeters, with colors at its corners where there are any.

    Raises
    ------
    OutputError
        For coordinates of an unknown unit: 3MF has none without.
    """
    if beside.unit not in MM:
        raise OutputError(
            "a 3MF file names a unit, and that of the coordinates is unknown",
            file=str(path),
            found=f"unit = {beside.unit}",
            expected=" | ".join(MM),
            hint="--units",
        )
    sized = mesh.moved(MM[beside.unit] * mesh.vertices)
    members = {**COMPANIONS, "3D/3dmodel.model": "".join(_model(sized, replace(beside, unit="mm")))}
    with replacing(path) as file, zipfile.ZipFile(file, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, text in members.items():
            entry = zipfile.ZipInfo(name, FIRST_DAY)
            entry.create_system = 3  # else it names the machine's
            archive.writestr(entry, text, zipfile.ZIP_DEFLATED)


def _model(mesh: TriMesh, beside: MeshAttributes) -> Iterator[str]:
    colors = named_colors(beside.vertex_fields)
    palette, numbers = np.unique(colors[1], axis=0, return_inverse=True) if colors else (None, np.zeros(0, np.int64))
    yield f'{DECLARATION}<model unit="millimeter" xml:lang="en-US" xmlns="{CORE}" xmlns:m="{MATERIAL}">\n'
    yield f'<metadata name="Application">tomomesh</metadata>\n<metadata name="Description">{beside.head}</metadata>\n'
    yield "<resources>\n"
    if palette is not None:
        yield f'<m:colorgroup id="{COLORS_ID}">\n'
        yield from (f'<m:color color="#{r:02X}{g:02X}{b:02X}"/>\n' for r, g, b in palette.tolist())
        yield "</m:colorgroup>\n"
    default = f' pid="{COLORS_ID}" pindex="0"' if colors else ""
    yield f'<object id="{MESH_ID}" type="model" name={quoteattr(beside.head)}{default}>\n<mesh>\n<vertices>\n'
    yield from (f'<vertex x="{x!r}" y="{y!r}" z="{z!r}"/>\n' for x, y, z in mesh.vertices.tolist())
    yield "</vertices>\n<triangles>\n"
    yield from _triangles(mesh, numbers.ravel() if colors else None)
    yield "</triangles>\n</mesh>\n</object>\n</resources>\n"
    yield f'<build>\n<item objectid="{MESH_ID}"/>\n</build>\n</model>\n'


def _triangles(mesh: TriMesh, numbers: np.ndarray[tuple[int], np.dtype[np.int64]] | None) -> Iterator[str]:
    if numbers is None:
        yield from (f'<triangle v1="{a}" v2="{b}" v3="{c}"/>\n' for a, b, c in mesh.faces.tolist())
        return
    for (a, b, c), (d, e, f) in zip(mesh.faces.tolist(), numbers[mesh.faces].tolist(), strict=True):
        yield f'<triangle v1="{a}" v2="{b}" v3="{c}" pid="{COLORS_ID}" p1="{d}" p2="{e}" p3="{f}"/>\n'
