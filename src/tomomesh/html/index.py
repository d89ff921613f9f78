"""The index of many results: a row each, and a link to its own file."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any
from urllib.parse import quote

from .. import __version__
from .page import asset, page
from .tables import in_words

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

SHOWN = {
    "faces": "faces", "components": "pieces", "cavities": "cavities", "self_intersections": "crossing faces",
    "area_mm2": "area (mm^2)", "volume_mm3": "volume (mm^3)", "points_to_surface_p95_mm": "95 % within (mm)",
    "warnings": "warnings",
}  # fmt: skip
"""Columns of the table of all results, and their heads."""


def index(title: str, rows: Sequence[Mapping[str, Any]], *, folder: str, command: str = "") -> str:
    """Return the index of many results as HTML.

    Parameters
    ----------
    title : str
    rows : sequence of mappings
        As of the table of a batch: ``name``, ``exit_code``, ``error``, ``sound``, and what `SHOWN` names.
    folder : str
        Where the file of each lies, seen from the index; empty for beside it.
    command : str
        That repeats them.

    Returns
    -------
    str
    """
    each = [
        {
            "name": row["name"],
            "link": quote("/".join([*([folder] if folder else []), f"{row['name']}.html"])),
            "failed": row.get("error") or "",
            "sound": bool(row.get("sound")) and not row.get("self_intersections"),
            "cells": [in_words(row.get(name)) for name in SHOWN],
        }
        for row in rows
    ]
    return page(
        "index.html.jinja", styles=[asset("style.css")], scripts=[asset("tables.js")], title=title, rows=each,
        heads=[*SHOWN.values()], command=command, version=__version__,
    )  # fmt: skip
