"""What the browser draws of a mesh or of points: few bytes, for show alone.

Layout of the bytes, read by `decodeScene` of assets/viewer.js, all little-endian: the length of a header, uint32; the
header, JSON, padded by spaces to a multiple of four; then one after the other, each padded by zeros to a multiple of
four: positions, uint16 (vertices, 3); corners of faces (faces, 3) and ends of lines (lines, 2), uint16 where there are
under 65536 vertices, else uint32; and values, float32 (vertices,) each. A vertex lies at ``low + step * position``.
"""

from __future__ import annotations

import base64
import json
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np

from ..model.mesh import QuadMesh
from .decimate import decimated, means

if TYPE_CHECKING:
    from collections.abc import Mapping

    from numpy.typing import NDArray

    from ..model.cubes import CubeGrid
    from ..model.mesh import TriMesh

    Floats = NDArray[np.float64]

LEVELS = 65535
"""Steps along the longest side: of 30 cm each is 5 um."""
SHOWN = 98.0
"""Percentile of values at which colors end. Chosen: of 100 a single outlier leaves all else in one color, of 95 the
worst twentieth looks alike."""
PATIENT = (("R", "L"), ("A", "P"), ("I", "S"))
"""Ends of the axes of LPS, the negative first."""
PLAIN = (("-x", "+x"), ("-y", "+y"), ("-z", "+z"))
"""Ends of the axes of what lies in no patient."""


@dataclass(frozen=True)
class Values:
    """A number at each vertex, for its color.

    Attributes
    ----------
    numbers : (n,) float array
        NaN where there is none.
    title : str
        In words.
    unit : str
    """

    numbers: Floats
    title: str
    unit: str = ""

    def told(self, name: str) -> dict[str, Any]:
        """Return what the header says of them."""
        known = self.numbers[np.isfinite(self.numbers)]
        low, high = (float(known.min()), float(np.percentile(known, SHOWN))) if len(known) else (0.0, 0.0)
        return {"name": name, "title": self.title, "unit": self.unit, "low": low, "high": high}


@dataclass(frozen=True)
class Scene:
    """What is drawn: faces, with their lines or without, or vertices alone.

    Attributes
    ----------
    vertices : (n, 3) float array
    faces : (m, 3) int array
    lines : (l, 2) int array
        Edges that the wire frame shows; where there are none, it shows those of the faces.
    values : mapping
        Name to `Values` at the vertices.
    of_faces : int
        Faces of what is shown, before it was decimated.
    of_points : int
        Points of what is shown without faces, before it was thinned out.
    unit : str
    axes : three pairs of str
        Names of the ends of x, y and z, the negative first.
    flat : bool
        Whether faces are drawn flat, as those of cubes.
    """

    vertices: Floats
    faces: NDArray[np.int64]
    lines: NDArray[np.int64] = field(default_factory=lambda: np.empty((0, 2), np.int64))
    values: Mapping[str, Values] = field(default_factory=dict)
    of_faces: int = 0
    of_points: int = 0
    unit: str = "mm"
    axes: tuple[tuple[str, str], ...] = PATIENT
    flat: bool = False

    @property
    def decimated(self) -> bool:
        """Whether fewer faces are shown than there are."""
        return len(self.faces) < self.of_faces

    @property
    def words(self) -> str:
        """Say how much of it is shown."""
        if not self.of_faces:
            return f"{len(self.vertices):,} of {self.of_points:,} points are shown."
        if not self.decimated:
            return f"All {self.of_faces:,} faces of the mesh are shown."
        return (
            f"For show, {len(self.faces):,} faces stand for the {self.of_faces:,} of the mesh: small details are lost "
            "here, not in the mesh itself."
        )

    def packed(self) -> bytes:
        """Return the bytes that the viewer reads; see the head of this module."""
        low, step = _frame(self.vertices)
        index = np.dtype("<u2" if len(self.vertices) <= LEVELS else "<u4")
        arrays = [
            np.rint((self.vertices - low) / step).astype("<u2"),
            self.faces.astype(index),
            self.lines.astype(index),
            *(one.numbers.astype("<f4") for one in self.values.values()),
        ]
        header = self._header(low, step, index.itemsize)
        return b"".join([len(header).to_bytes(4, "little"), header, *map(_padded, (a.tobytes() for a in arrays))])

    def base64(self) -> str:
        """Return the same as text."""
        return base64.b64encode(self.packed()).decode()

    def _header(self, low: Floats, step: float, index_bytes: int) -> bytes:
        told = {
            "vertices": len(self.vertices), "faces": len(self.faces), "lines": len(self.lines),
            "of_faces": self.of_faces, "low": low.tolist(), "step": step, "index_bytes": index_bytes,
            "unit": self.unit, "axes": self.axes, "flat": self.flat,
            "values": [one.told(name) for name, one in self.values.items()],
        }  # fmt: skip
        return _padded(json.dumps(told, allow_nan=False, separators=(",", ":")).encode(), b" ")


def scene_of_mesh(
    mesh: TriMesh, *, most: int | None = None, values: Mapping[str, Values] | None = None, unit: str = "mm",
    axes: tuple[tuple[str, str], ...] = PATIENT,
) -> Scene:  # fmt: skip
    """Return what is shown of a mesh.

    Parameters
    ----------
    mesh : TriMesh
    most : int, optional
        Faces to show at most; by default all.
    values : mapping, optional
        Name to `Values` at the vertices; vertices that become one have the mean of theirs.
    unit : str
    axes : three pairs of str

    Returns
    -------
    Scene
    """
    fewer, became = decimated(mesh, len(mesh.faces) if most is None else most)
    same = fewer is mesh
    at = {
        name: one if same else Values(means(one.numbers, became), one.title, one.unit)
        for name, one in (values or {}).items()
    }
    return Scene(fewer.vertices, fewer.faces, values=at, of_faces=len(mesh.faces), unit=unit, axes=axes)


def scene_of_quads(quads: QuadMesh, *, unit: str = "mm", axes: tuple[tuple[str, str], ...] = PATIENT) -> Scene:
    """Return what is shown of a cuberille: flat squares, and their sides."""
    faces = quads.quads[:, [0, 1, 2, 0, 2, 3]].reshape(-1, 3)
    return Scene(quads.vertices, faces, quads.edges, of_faces=len(faces), unit=unit, axes=axes, flat=True)


CORNERS = np.array([(x, y, z) for z in (0, 1) for y in (0, 1) for x in (0, 1)])
"""Corners of a cube, in its edges."""
SIDES = np.array([(0, 2, 3, 1), (4, 5, 7, 6), (0, 1, 5, 4), (2, 6, 7, 3), (0, 4, 6, 2), (1, 3, 7, 5)])
"""Its sides, each outward."""
APART = 0.06
"""Part of an edge that is left out around a cube, so that neighbors are seen apart. Only a picture depends on it."""


def scene_of_cubes(cubes: CubeGrid, *, unit: str = "mm", axes: tuple[tuple[str, str], ...] = PATIENT) -> Scene:
    """Return what is shown of cubes: each by itself."""
    inside = APART + (1 - 2 * APART) * CORNERS
    corners = cubes.origin + cubes.cell_mm * (cubes.cells[:, None] + inside)
    quads = 8 * np.arange(len(corners))[:, None, None] + SIDES
    return scene_of_quads(QuadMesh(corners.reshape(-1, 3), quads.reshape(-1, 4)), unit=unit, axes=axes)


def scene_of_points(
    positions: Floats, *, most: int | None = None, unit: str = "mm", axes: tuple[tuple[str, str], ...] = PATIENT
) -> Scene:
    """Return what is shown of points (n, 3): all, or of more than `most` every second, third and so on."""
    step = 1 if most is None else -(-len(positions) // most) or 1
    none = np.empty((0, 3), np.int64)
    return Scene(positions[::step], none, of_points=len(positions), unit=unit, axes=axes)


def _frame(vertices: Floats) -> tuple[Floats, float]:
    """Return the lowest corner, and the step in which positions are counted from there."""
    if not len(vertices):
        return np.zeros(3), 1.0
    low = vertices.min(axis=0)
    return low, float((vertices - low).max()) / LEVELS or 1.0


def _padded(part: bytes, filler: bytes = b"\0") -> bytes:
    return part + filler * (-len(part) % 4)
