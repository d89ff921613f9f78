"""VTP, the XML of VTK's polygons, for meshes and for points: ParaView, 3D Slicer and PyVista open it.

Written with the standard library: VTK is 100 MB, and meshio has no VTP. VTK judges the files in the tests.
"""

from __future__ import annotations

import base64
from typing import TYPE_CHECKING, Any

import numpy as np

from ..colors import named_colors
from ..fields import IDS, flat_columns
from ..files.atomic import replacing
from .attributes import narrowed

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path

    from numpy.typing import NDArray

    from ...model.mesh import TriMesh
    from ...model.points import PointSet
    from ..fields import Fields
    from .attributes import MeshAttributes

VTK_TYPES = {
    "i1": "Int8", "u1": "UInt8", "i2": "Int16", "u2": "UInt16", "i4": "Int32", "u4": "UInt32",
    "i8": "Int64", "u8": "UInt64", "f4": "Float32", "f8": "Float64",
}  # fmt: skip
"""NumPy's codes of the types of numbers to VTK's names."""

PARTS = ("Verts", "Lines", "Strips", "Polys")
"""The kinds of cells, in the order of the file."""


def write_vtp_mesh(mesh: TriMesh, path: str | Path, beside: MeshAttributes) -> None:
    """Write a mesh with all its fields, of 64-bit coordinates unless asked else; colors are one array named ``RGB``."""
    point_data, cell_data = _arrays(beside.vertex_fields), _arrays(beside.face_fields)
    _write(path, beside, mesh.vertices, "Polys", mesh.faces, point_data, cell_data)


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
                *_section("Points", {"Points": narrowed(positions, single=beside.single)}),
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
