"""VTP, the XML of VTK's polygons, for meshes and for points: ParaView, 3D Slicer and PyVista open it.

Written with the standard library: VTK is 100 MB, and meshio has no VTP. VTK judges the files in the tests.
"""

from __future__ import annotations

import base64
from typing import TYPE_CHECKING, Any

import numpy as np

from ...errors import FormatError
from ...model.points import COLORS
from ..colors import named_colors
from ..fields import IDS, doubles, flat_columns
from ..files.atomic import replacing
from ..files.source import whole
from .attributes import narrowed
from .cells import fans, strips, together
from .vtk_arrays import TYPES, PolyData

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path
    from xml.etree.ElementTree import Element

    from numpy.typing import NDArray

    from ...model.mesh import TriMesh
    from ...model.points import PointSet
    from ..fields import Cloud, Fields
    from .attributes import MeshAttributes
    from .cells import Arrays

VTK_TYPES = {code: name for name, code in TYPES.items()}
"""NumPy's codes of the types of numbers to VTK's names."""

PARTS = ("Verts", "Lines", "Strips", "Polys")
"""The kinds of cells, in the order of the file."""


def write_vtp_mesh(mesh: TriMesh, path: str | Path, beside: MeshAttributes) -> None:
    """Write a mesh with all its fields, of 64-bit coordinates unless asked else; colors are one array named ``RGB``."""
    point_data, cell_data = _arrays(beside.vertex_fields), _arrays(beside.face_fields)
    _write(path, beside, mesh.vertices, "Polys", mesh.faces, point_data, cell_data)


def read_vtp_mesh(data: bytes, file: str) -> Arrays:
    """Read the vertices, polygons and strips of a file of anybody's, these cut into triangles.

    Raises
    ------
    FormatError
        For a file that is none of VTK's polygons, or is broken.
    """
    parsed = PolyData.parsed(data, file)
    return together((_positions(parsed, piece), _faces(parsed, piece)) for piece in parsed.pieces)


def _faces(parsed: PolyData, piece: Element) -> NDArray[np.int64]:
    """Return the polygons and strips of a piece, cut into triangles."""
    found = []
    for kind, cut in (("Polys", fans), ("Strips", strips)):
        cells = parsed.arrays(piece, kind)
        corners, ends = (np.asarray(cells.get(name, np.empty(0)), np.int64) for name in ("connectivity", "offsets"))
        sizes = np.diff(ends, prepend=0)
        if (sizes < 3).any() or sizes.sum() != len(corners):
            raise FormatError("the polygons cannot be understood", file=parsed.file)
        found.append(cut(corners, sizes))
    return np.concatenate(found) if len(found[1]) else found[0]


def read_vtp(path: Path) -> Cloud:
    """Read the points of a file of anybody's, and what it says of each.

    Raises
    ------
    FormatError
    """
    parsed = PolyData.parsed(whole(path), str(path))
    pieces = [(_positions(parsed, piece), parsed.arrays(piece, "PointData")) for piece in parsed.pieces]
    if not pieces:
        return np.empty((0, 3)), {}
    shared = set.intersection(*(set(fields) for _, fields in pieces))
    names = [name for name in pieces[0][1] if name in shared]
    fields = {name: np.concatenate([fields[name] for _, fields in pieces]) for name in names}
    positions = np.concatenate([positions for positions, _ in pieces])
    if any(len(values) != len(positions) for values in fields.values()):
        raise FormatError("an array does not fit the points", file=str(path))
    return positions, _apart(fields)


def vtp_frame(data: bytes, file: str) -> dict[str, str]:
    """Return the unit and the frame of a file that tomomesh wrote; none of another's."""
    texts = PolyData.parsed(data, file).texts()
    own = texts.get("written_by", "").startswith("tomomesh")
    return {name: texts[name] for name in ("unit", "frame") if own and name in texts}


def _positions(parsed: PolyData, piece: Element) -> NDArray[np.float64]:
    found = [*parsed.arrays(piece, "Points").values()]
    if len(found) != 1 or found[0].shape != (int(piece.get("NumberOfPoints", 0)), 3):
        raise FormatError("the points have no positions", file=parsed.file, expected="three numbers each")
    return doubles(found[0])


def _apart(fields: Fields) -> Fields:
    """Take colors that are one array apart."""
    colors = fields.get("RGB")
    if colors is None or colors.ndim != 2 or colors.dtype != np.uint8:
        return fields
    return {name: values for name, values in fields.items() if name != "RGB"} | dict(
        zip(COLORS, colors.T, strict=False)
    )


def write_vtp_points(points: PointSet, path: str | Path, beside: MeshAttributes) -> None:
    """Write points, each a vertex cell, with slice, neuron, kind and all attributes."""
    ids: Fields = dict(zip(IDS, (points.slices, points.neurons, points.kinds), strict=True))
    fields = _arrays({**ids, **flat_columns(points.attributes, len(points), ids)})
    _write(path, beside, points.positions, "Verts", np.arange(len(points))[:, None], fields, {})


def _arrays(fields: Fields) -> Fields:
    """Return the fields under their names, the three colors as one array of bytes (n, 3)."""
    colors = named_colors(fields)
    if colors is None:
        return fields
    others = {name: values for name, values in fields.items() if name not in colors[0]}
    return {"RGB": colors[1], **others}


def _write(
    path: str | Path,
    beside: MeshAttributes,
    positions: NDArray[np.float64],
    part: str,
    cells: NDArray[np.int64],
    point_data: Fields,
    cell_data: Fields,
) -> None:
    counts = "".join(f' NumberOf{name}="{len(cells) if name == part else 0}"' for name in PARTS)
    with replacing(path) as file:
        file.writelines(
            line.encode("ascii") + b"\n"
            for line in (
                '<?xml version="1.0"?>',
                '<VTKFile type="PolyData" version="1.0" byte_order="LittleEndian" header_type="UInt64">',
                "<PolyData>",
                *_texts({"unit": beside.unit, "frame": beside.frame, "written_by": beside.head}),
                f'<Piece NumberOfPoints="{len(positions)}"{counts}>',
                *_section("PointData", point_data),
                *_section("CellData", cell_data),
                *_section("Points", {"Points": narrowed(positions, beside)}),
                *(line for name in PARTS for line in _cells(name, cells if name == part else cells[:0])),
                "</Piece>",
                "</PolyData>",
                "</VTKFile>",
            )
        )


def _texts(texts: dict[str, str]) -> Iterator[str]:
    """Yield texts about the whole file; VTK spells them as the codes of their letters, with a 0 behind."""
    yield "<FieldData>"
    for name, text in texts.items():
        codes = " ".join(str(code) for code in (*text.encode("utf-8"), 0))
        yield f'<Array type="String" Name="{name}" NumberOfTuples="1" format="ascii">{codes}</Array>'
    yield "</FieldData>"


def _cells(name: str, cells: NDArray[np.int64]) -> Iterator[str]:
    ends = np.arange(1, len(cells) + 1, dtype=np.int64) * cells.shape[1]
    return _section(name, {"connectivity": cells.ravel(), "offsets": ends})


def _section(name: str, arrays: Fields) -> Iterator[str]:
    active = ' Scalars="RGB"' if "RGB" in arrays else ""
    yield f"<{name}{active}>"
    for array, values in arrays.items():
        yield _array(array, values)
    yield f"</{name}>"


def _array(name: str, values: NDArray[Any]) -> str:
    """Return an array: its bytes behind their count, in letters."""
    values = values if values.dtype.str[1:] in VTK_TYPES else values.astype(np.float64)
    raw = np.ascontiguousarray(values, values.dtype.newbyteorder("<")).tobytes()
    data = base64.b64encode(len(raw).to_bytes(8, "little") + raw).decode("ascii")
    width = f' NumberOfComponents="{values.shape[1]}"' if values.ndim == 2 else ""
    return (
        f'<DataArray type="{VTK_TYPES[values.dtype.str[1:]]}" Name="{name}"{width} format="binary">{data}</DataArray>'
    )
