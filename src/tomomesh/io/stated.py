"""What a mesh file of tomomesh states of its coordinates: `signature`, read back."""

from __future__ import annotations

import re
from pathlib import Path

from .meshes import STL_TEXT
from .source import suffix_of

HEAD = 300
"""Bytes that hold the longest signature and what the formats have before it."""
SIGNATURE = re.compile(rb"(?:^|# |comment )tomomesh ([^\r\n]*)", re.MULTILINE)


def stated(path: str | Path) -> dict[str, str]:
    """Return the `unit` and the `frame` that a mesh file states; none of them where it is not tomomesh's own.

    Parameters
    ----------
    path : path
        One of `MESH_READERS`, already known to be readable.
    """
    with Path(path).open("rb") as file:
        found = SIGNATURE.search(file.read(STL_TEXT if suffix_of(path) == ".stl" else HEAD))
    words = found[1].decode("ascii", "replace").split() if found else []
    named = dict(word.split("=", 1) for word in words if "=" in word)
    return {name: value for name, value in named.items() if name in ("unit", "frame")}
