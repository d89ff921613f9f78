"""Attributes of a mesh that a writer is given beside it, and the single precision of 32-bit formats."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from ...errors import OutputError
from ..files.signature import signature
from .cells import weld

if TYPE_CHECKING:
    from pathlib import Path

    from numpy.typing import NDArray

    from ..fields import Fields


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
    """Return 32-bit coordinates, if they still tell the vertices apart.

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
        Where two vertices would fall together, or a coordinate is too large.
    """
    narrow = _narrow(vertices)
    if narrow is None:
        raise OutputError(
            f"the 32-bit coordinates of {kind} cannot keep the vertices apart",
            file=str(path),
            found=f"largest coordinate = {np.abs(vertices).max():g}",
            hint="a .ply file, which keeps 64 bits, or --local-origin for a cloud",
        )
    return narrow


def _narrow(positions: NDArray[np.float64]) -> NDArray[np.float32] | None:
    """Return positions in 32 bits, None where two would fall together, or one is too large."""
    with np.errstate(over="ignore"):
        narrow = positions.astype(np.float32)
    apart = np.isfinite(narrow).all() and len(weld(narrow.astype(np.float64))[0]) == len(weld(positions)[0])
    return narrow if apart else None
