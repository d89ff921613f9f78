"""Attributes of a mesh that a writer is given beside it, and the single precision of 32-bit formats."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from ...errors import OutputError
from ...model.mesh import TriMesh
from ..files.signature import signature
from .pieces.parts import InOnePiece

if TYPE_CHECKING:
    from pathlib import Path

    from numpy.typing import NDArray

    from ..fields import Fields
    from .pieces.parts import Parts


MOVED = 1 / 32
"""Part of the vertices' distance by which 32 bits may move one. Faces of a fine sphere, at 1.2 degrees to each other on
average, then lie at 2.5; at half of it at 1.6, at twice at 4.7, and at eight times some stand upright, though no two
vertices fall together."""


@dataclass(frozen=True)
class MeshAttributes:
    """Unit, frame and fields of a mesh that is written.

    Attributes
    ----------
    unit, frame : str
        What the coordinates are in.
    vertex_fields, face_fields : dict of str to (n,) or (m,) array
        Single columns of numbers, by name.
    z_up : bool
        Whether z is up where the frame does not say so, as of a part to print.
    single : bool
        Whether formats of 64 bits are to hold 32, where these keep the vertices apart.
    fits : bool, optional
        Whether they do, where that is known: of the whole that this is a piece of.
    """

    unit: str
    frame: str
    vertex_fields: Fields
    face_fields: Fields
    z_up: bool = False
    single: bool = False
    fits: bool | None = None

    @property
    def head(self) -> str:
        """One line about the file: program, version, unit and frame."""
        return signature(self.unit, self.frame)


def narrowed(positions: NDArray[np.float64], beside: MeshAttributes) -> NDArray[np.floating[Any]]:
    """Return positions (n, 3) in 32 bits where that was asked for and keeps them apart, else in 64."""
    return np.asarray(positions, kind_of(_alone(positions), beside))


def kind_of(mesh: Parts, beside: MeshAttributes) -> type[np.floating[Any]]:
    """Return 32 bits where these were asked for and keep the vertices apart and in place, else 64."""
    return np.float32 if beside.single and fits_single(mesh, beside.fits) else np.float64


def single_precision(vertices: NDArray[np.float64], path: str | Path, *, kind: str) -> NDArray[np.float32]:
    """Return 32-bit coordinates (n, 3), if they still tell the vertices apart and leave the surface smooth.

    Raises
    ------
    OutputError
        As `require_single`.
    """
    require_single(_alone(vertices), path, kind=kind)
    return np.asarray(vertices, np.float32)


def require_single(mesh: Parts, path: str | Path, *, kind: str, known: bool | None = None) -> None:
    """Refuse a mesh whose vertices 32 bits do not keep apart and in place.

    Parameters
    ----------
    mesh : Parts
    path : path
        The output.
    kind : str
        Name of the format, for the error.
    known : bool, optional
        See `MeshAttributes.fits`.

    Raises
    ------
    OutputError
        Where two vertices would fall together, one would move too far, or a coordinate is too large.
    """
    if not fits_single(mesh, known):
        largest = max((float(np.abs(some).max()) for some in mesh.vertices()), default=0.0)
        raise OutputError(
            f"the 32-bit coordinates of {kind} cannot keep the vertices apart and in place",
            file=str(path),
            found=f"largest coordinate = {largest:g}",
            hint="a .ply file, which keeps 64 bits, or --local-origin for a cloud",
        )


def fits_single(mesh: Parts, known: bool | None = None) -> bool:
    """Whether in 32 bits no coordinate is too large, none moves too far, and no two vertices fall together."""
    if known is not None:
        return known
    moved, low, high = 0.0, np.full(3, np.inf), np.full(3, -np.inf)
    with np.errstate(over="ignore", invalid="ignore"):
        for some in mesh.vertices():
            moved = float(np.maximum(moved, np.abs(some.astype(np.float32) - some).max()))
            low, high = np.minimum(low, some.min(axis=0)), np.maximum(high, some.max(axis=0))
    if not (np.isfinite(moved) and moved <= MOVED * _distance(low, high, mesh.vertex_count)):
        return False
    apart = mesh.distinct(np.float32)
    # most meshes have each position once: then the exact ones need not be counted
    return apart == mesh.vertex_count or apart == mesh.distinct(np.float64)


def _alone(positions: NDArray[np.float64]) -> InOnePiece:
    return InOnePiece(TriMesh(positions, np.empty((0, 3), np.int64)))


def _distance(low: NDArray[np.float64], high: NDArray[np.float64], count: int) -> float:
    """Return how far apart so many positions are that lie evenly on the faces of their box; of one, without a limit."""
    if count < 2:
        return np.inf
    a, b, c = high - low
    return float(np.sqrt(2 * (a * b + b * c + c * a) / count))
