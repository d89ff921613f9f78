"""Attributes of a mesh that a writer is given beside it, and the single precision of 32-bit formats."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from ...errors import OutputError
from ...measure.topology import count_positions
from ...model.columns import box
from ..files.signature import signature

if TYPE_CHECKING:
    from pathlib import Path

    from numpy.typing import NDArray

    from ..fields import Fields


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
    """

    unit: str
    frame: str
    vertex_fields: Fields
    face_fields: Fields
    z_up: bool = False
    single: bool = False

    @property
    def head(self) -> str:
        """One line about the file: program, version, unit and frame."""
        return signature(self.unit, self.frame)


def narrowed(positions: NDArray[np.float64], *, single: bool) -> NDArray[np.floating[Any]]:
    """Return positions (n, 3) in 32 bits where that was asked for and keeps them apart, else in 64."""
    narrow = _narrow(positions) if single else None
    return np.asarray(positions, np.float64) if narrow is None else narrow


def single_precision(vertices: NDArray[np.float64], path: str | Path, *, kind: str) -> NDArray[np.float32]:
    """Return 32-bit coordinates, if they still tell the vertices apart and leave the surface smooth.

    Parameters
    ----------
    vertices : (n, 3) float array
        Positions.
    path : path
        The output.
    kind : str
        Name of the format, for the error.

    Raises
    ------
    OutputError
        Where two vertices would fall together, one would move too far, or a coordinate is too large.
    """
    narrow = _narrow(vertices)
    if narrow is None:
        raise OutputError(
            f"the 32-bit coordinates of {kind} cannot keep the vertices apart and in place",
            file=str(path),
            found=f"largest coordinate = {np.abs(vertices).max():g}",
            hint="a .ply file, which keeps 64 bits, or --local-origin for a cloud",
        )
    return narrow


def _narrow(positions: NDArray[np.float64]) -> NDArray[np.float32] | None:
    """Return positions in 32 bits, None where one is too large or would move too far, or two would fall together."""
    with np.errstate(over="ignore"):
        narrow = positions.astype(np.float32)
    wide = narrow.astype(np.float64, order="C")
    near = np.isfinite(wide).all() and np.abs(wide - positions).max(initial=0) <= MOVED * _distance(positions)
    if not near:
        return None
    apart, exact = count_positions(wide), np.array(positions, np.float64, order="C")
    # most meshes have each position once: then the exact ones need not be counted
    all_apart = apart == len(positions) or apart == count_positions(exact)
    return narrow if all_apart else None


def _distance(positions: NDArray[np.float64]) -> float:
    """Return how far apart so many positions are that lie evenly on the faces of their box; of one, without a limit."""
    if len(positions) < 2:
        return np.inf
    lowest, highest = box(positions)
    a, b, c = highest - lowest
    return float(np.sqrt(2 * (a * b + b * c + c * a) / len(positions)))
