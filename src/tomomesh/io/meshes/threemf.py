"""3MF: the zip of XML that slicers for 3D printing read.

In millimeters always: Slic3r, OpenSCAD and assimp pass over the unit that a model names.

Written with the standard library: it is one text in a zip with two fixed companions. trimesh's exporter stamps the time
and random ids into the file, and lib3mf is a compiled library; it judges what is written here in the tests.
"""

from __future__ import annotations

import io
import zipfile
from dataclasses import dataclass, field, replace
from functools import cached_property
from itertools import chain, islice
from operator import itemgetter
from typing import TYPE_CHECKING

import numpy as np

from ...errors import FormatError, OutputError
from ...model.columns import carried
from ...model.units import MM, unit_named
from ..colors import named_colors
from ..files.atomic import replacing
from ..files.limits import require_memory
from ..files.markup import parsed_until, parsed_xml
from ..files.source import third_party
from ..frames import frame_in_file
from ..text import written
from .attributes import single_precision
from .cells import together

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path

    from numpy.typing import NDArray

    from ...model.mesh import TriMesh
    from .attributes import MeshAttributes
    from .cells import Arrays

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

MOST_PIECES = 1 << 16
"""Objects that a file may build, those within others counted each time: they could double from object to object."""

IDENTITY = "1 0 0 0 1 0 0 0 1 0 0 0"
"""The place of what has none, as four rows of three."""

RESOURCES, VERTEX, TRIANGLE, OBJECT, COMPONENT, ITEM = (
    f"{{{CORE}}}{name}" for name in ("resources", "vertex", "triangle", "object", "component", "item")
)
"""The elements that are read."""


LARGEST_MM = 1e9
"""Largest coordinate that lib3mf takes, with which MeshLab and others read."""


def write_3mf(mesh: TriMesh, path: str | Path, beside: MeshAttributes) -> None:
    """Write one object of 64-bit coordinates in millimeters, with colors at its corners where there are any.

    Raises
    ------
    OutputError
        For coordinates of an unknown unit: 3MF has none without; and for such as its readers, which keep 32 bits,
        could not tell apart.
    """
    if beside.unit not in MM:
        raise OutputError(
            "a 3MF file names a unit, and that of the coordinates is unknown",
            file=str(path),
            found=f"unit = {beside.unit}",
            expected="a unit of length, as mm",
            hint="--units",
        )
    frame = frame_in_file(path, unit=beside.unit, frame=beside.frame)
    sized = mesh.moved(frame.place(mesh.vertices))
    _check_readable(sized.vertices, path)
    members = {**COMPANIONS, "3D/3dmodel.model": "".join(_model(sized, replace(beside, unit=frame.unit)))}
    with replacing(path) as file, zipfile.ZipFile(file, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, text in members.items():
            entry = zipfile.ZipInfo(name, FIRST_DAY)
            entry.create_system = 3  # else it names the machine's
            archive.writestr(entry, text, zipfile.ZIP_DEFLATED)


def _check_readable(vertices: NDArray[np.float64], path: str | Path) -> None:
    """Refuse coordinates that the file holds, and its readers do not: they keep 32 bits."""
    largest = np.abs(vertices).max()
    if largest > LARGEST_MM:
        raise OutputError(
            "programs refuse a 3MF file that lies so far from 0",
            file=str(path),
            found=f"largest coordinate = {largest:g} mm",
            expected=f"at most {LARGEST_MM:g} mm",
            hint="a .ply file, or --local-origin for a cloud",
        )
    single_precision(vertices, path, kind="3MF readers")


def _model(mesh: TriMesh, beside: MeshAttributes) -> Iterator[str]:
    from xml.sax.saxutils import quoteattr  # imports what speaks with servers

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
    yield written('<vertex x="%r" y="%r" z="%r"/>\n', *mesh.vertices.T.tolist())
    yield "</vertices>\n<triangles>\n"
    yield _triangles(mesh, numbers.ravel() if colors else None)
    yield "</triangles>\n</mesh>\n</object>\n</resources>\n"
    yield f'<build>\n<item objectid="{MESH_ID}"/>\n</build>\n</model>\n'


def _triangles(mesh: TriMesh, numbers: NDArray[np.int64] | None) -> str:
    row, columns = '<triangle v1="%d" v2="%d" v3="%d"/>\n', mesh.faces.T.tolist()
    if numbers is not None:
        row = row.replace("/>", f' pid="{COLORS_ID}" p1="%d" p2="%d" p3="%d"/>')
        columns += numbers[mesh.faces].T.tolist()
    return written(row, *columns)


def read_3mf(data: bytes, file: str) -> Arrays:
    """Read the meshes that a file builds, each where it builds it, in the file's unit.

    Raises
    ------
    FormatError
        For a file that is no zip with one model, or whose model cannot be understood.
    """
    model = parsed_xml(_text(data, file), file, Model())
    try:
        every = chain.from_iterable(model.placed(item, np.eye(4, 3), len(model.objects)) for item in model.items)
        placed = list(islice(every, MOST_PIECES + 1))
        if len(placed) > MOST_PIECES:
            raise ValueError(len(placed))
    except (KeyError, ValueError, TypeError, IndexError, OverflowError):
        raise FormatError("the model cannot be understood", file=file, expected="objects and a build of 3MF") from None
    return together(placed)


def threemf_frame(data: bytes, file: str) -> dict[str, str]:
    """Return the unit, and the frame where tomomesh wrote the file."""
    root = parsed_until(RESOURCES, _text(data, file), file)
    told = next((one.text or "" for one in root.iter(f"{{{CORE}}}metadata") if one.get("name") == "Description"), "")
    frame = [word.removeprefix("frame=") for word in told.split() if word.startswith("frame=")]
    unit = {"unit": unit_named(root.get("unit", "")) or "mm"}
    return unit | ({"frame": frame[0]} if told.startswith("tomomesh") and frame else {})


def _text(data: bytes, file: str) -> bytes:
    """Return the model of a package."""
    with third_party("zipfile", file), zipfile.ZipFile(io.BytesIO(data)) as archive:
        models = [one for one in archive.infolist() if one.filename.lower().endswith("3d/3dmodel.model")]
        if len(models) != 1:
            raise FormatError("the file has no model", file=file, expected="3D/3dmodel.model")
        require_memory(models[0].file_size, file=file)
        return archive.read(models[0])


@dataclass
class Solid:
    """An object of a file, by the attributes of its parts."""

    vertices: list[dict[str, str]] = field(default_factory=list)
    triangles: list[dict[str, str]] = field(default_factory=list)
    components: list[dict[str, str]] = field(default_factory=list)

    @cached_property
    def arrays(self) -> Arrays:
        """Its mesh, empty or not."""
        places = chain.from_iterable(map(itemgetter("x", "y", "z"), self.vertices))
        corners = chain.from_iterable(map(itemgetter("v1", "v2", "v3"), self.triangles))
        vertices, faces = np.fromiter(map(float, places), np.float64), np.fromiter(map(int, corners), np.int64)
        return vertices.reshape(-1, 3), faces.reshape(-1, 3)


class Model:
    """The objects and the build of a file, told by a parser: a tree of all elements takes as long again."""

    def __init__(self) -> None:
        self.objects: dict[str, Solid] = {}
        self.items: list[dict[str, str]] = []
        self.solid = Solid()

    def start(self, tag: str, attributes: dict[str, str]) -> None:
        """Take an element; what stands before the first object belongs to none."""
        if tag == VERTEX:
            self.solid.vertices.append(attributes)
        elif tag == TRIANGLE:
            self.solid.triangles.append(attributes)
        elif tag == OBJECT:
            self.solid = self.objects[attributes.get("id", "")] = Solid()
        elif tag == COMPONENT:
            self.solid.components.append(attributes)
        elif tag == ITEM:
            self.items.append(attributes)

    def close(self) -> Model:
        """End."""
        return self

    def placed(self, item: dict[str, str], outer: NDArray[np.float64], depth: int) -> Iterator[Arrays]:
        """Yield the mesh of an item or a component, and of the components of its object; `depth` ends circles."""
        if depth < 0:
            raise ValueError(depth)
        own = np.array(item.get("transform", IDENTITY).split(), np.float64).reshape(4, 3)
        matrix = np.vstack([own[:3] @ outer[:3], own[3] @ outer[:3] + outer[3]])
        found = self.objects[item.get("objectid", "")]
        vertices, faces = found.arrays
        mirrored = np.linalg.det(matrix[:3]) < 0
        yield carried(vertices, matrix[:3], matrix[3]), faces[:, ::-1] if mirrored else faces
        for component in found.components:
            yield from self.placed(component, matrix, depth - 1)
