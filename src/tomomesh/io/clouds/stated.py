"""The unit and the frame that a cloud's file states."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from ..files.source import suffix_of
from ..meshes.frame import frame_of_file
from .delimited import columns_stated
from .las import las_stated

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

STATED: dict[str, Callable[[Path], dict[str, Any]]] = {
    ".e57": lambda path: {"unit": "m"},  # ASTM E2807: lengths are meters
    ".ptx": lambda path: {"unit": "m"},  # Leica's own: always metric
    ".las": las_stated,
    ".laz": las_stated,
    ".csv": columns_stated,
    ".txt": columns_stated,
    ".xyz": columns_stated,
    ".asc": columns_stated,
}
"""Suffix to what a file of anybody's states of its coordinates."""


def stated_of(path: Path) -> dict[str, Any]:
    """Return the ``unit`` and the ``frame`` that a file names, and ``notes``; none of them where it names none.

    Parameters
    ----------
    path : Path
        Already known to be readable. What tomomesh wrote names itself.
    """
    own = frame_of_file(path)
    state = STATED.get(suffix_of(path))
    return own if own or state is None else state(path)
