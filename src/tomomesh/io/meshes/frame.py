"""The frame of a mesh file of tomomesh: `signature`, read back."""

from __future__ import annotations

import re
from pathlib import Path
from typing import TYPE_CHECKING

from ..files.source import suffix_of, whole
from .encapsulated import encapsulated_frame
from .gifti import gifti_frame
from .glb import glb_frame
from .stl import STL_HEADER_BYTES
from .threemf import threemf_frame
from .vtp import vtp_frame

if TYPE_CHECKING:
    from collections.abc import Callable

SIGNED_BYTES = 300
"""Bytes that hold the longest signature, 60, and what the formats have before it, of which PLY's 44 are the most."""

SIGNATURE = re.compile(rb"(?:^|# |comment )tomomesh ([^\r\n]*)", re.MULTILINE)


FRAMES: dict[str, Callable[[bytes, str], dict[str, str]]] = {
    ".vtp": vtp_frame,
    ".3mf": threemf_frame,
    ".glb": glb_frame,
    ".gii": gifti_frame,
    ".dcm": encapsulated_frame,
}
"""Suffix to what a file's own fields state."""


def frame_of_file(path: str | Path) -> dict[str, str]:
    """Return the `unit` and the `frame` that a mesh file names; none of them where it is not tomomesh's own.

    Parameters
    ----------
    path : path
        One of `MESH_READERS`, already known to be readable. Some of these name their unit whoever wrote them.
    """
    if (state := FRAMES.get(suffix_of(path))) is not None:
        return state(whole(path), str(path))
    with Path(path).open("rb") as file:
        found = SIGNATURE.search(file.read(STL_HEADER_BYTES if suffix_of(path) == ".stl" else SIGNED_BYTES))
    words = found[1].decode("ascii", "replace").split() if found else []
    named = dict(word.split("=", 1) for word in words if "=" in word)
    return {name: value for name, value in named.items() if name in ("unit", "frame")}
