"""three.js, out of the page that trimesh ships: never copied into tomomesh."""

from __future__ import annotations

import zipfile
from functools import cache
from importlib.util import find_spec
from pathlib import Path

SHIPPED = ("resources", "templates", "viewer.zip")
PAGE = "viewer.html.template"
BEGIN = "/**\n * @license"
"""What three.js begins with: its license, which so stays with it."""
END = "THREE.TrackballControls=TrackballControls;})();"
"""What the controls of the camera end with; what follows reads files and draws trimesh's own page."""


@cache
def three_js() -> str:
    """Return three.js with its TrackballControls, a classic script that sets the global `THREE`.

    Returns
    -------
    str
        MIT license, which it begins with; empty where trimesh ships it otherwise: pages show pictures then.
    """
    found = find_spec("trimesh")
    if found is None or found.origin is None:
        return ""
    shipped = Path(found.origin).parent.joinpath(*SHIPPED)
    try:
        with zipfile.ZipFile(shipped) as archive:
            page = archive.read(PAGE).decode()
    except (OSError, KeyError, ValueError, zipfile.BadZipFile):
        return ""
    return cut_out(page)


def cut_out(page: str) -> str:
    """Return the library in trimesh's page, or nothing where it is not as it is known, or could end a script early."""
    begin, end = page.find(BEGIN), page.find(END)
    library = page[begin : end + len(END)] if 0 <= begin < end else ""
    return "" if "</script" in library.lower() or "<!--" in library else library
