"""The unit and the frame that a cloud's file states."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from ..files.source import suffix_of
from ..meshes.frame import frame_of_file
from .delimited import columns_frame
from .las import las_frame

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

FRAMES: dict[str, Callable[[Path], dict[str, Any]]] = {
    ".e57": lambda path: {"unit": "m"},  # ASTM E2807: lengths are meters
    ".ptx": lambda path: {"unit": "m"},  # Leica's own: always metric
    ".las": las_frame,
    ".laz": las_frame,
    ".csv": columns_frame,
    ".tsv": columns_frame,
    ".txt": columns_frame,
    ".xyz": columns_frame,
    ".asc": columns_frame,
}
"""Suffix to what a file of anybody's states of its coordinates."""


def frame_of_cloud(path: Path) -> dict[str, Any]:
    """Return the ``unit`` and the ``frame`` that a file names, and ``notes``; none of them where it names none.

    Parameters
    ----------
    path : Path
        Already known to be readable. What tomomesh wrote names itself.
    """
    own = frame_of_file(path)
    state = FRAMES.get(suffix_of(path))
    return own if own or state is None else state(path)
