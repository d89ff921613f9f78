"""A result as one HTML file: what it is, whether it is good to use, and everything that is known of it."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

from .. import __version__
from .citation import citations
from .page import asset, page
from .pictures import SHADED, Picture, pictures_of
from .places import PROBLEM
from .tables import tables_of
from .three import three_js
from .verdict import verdict_of

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from .histogram import Histogram
    from .places import Problem
    from .scene import Scene

MOST = 40_000
"""Faces that the file shows. Chosen: 60,000 are .9 MB of a file of 3, and look the same on a screen; of 20,000 the ears
of a head lose their edge."""


@dataclass(frozen=True)
class Contents:
    """What a file tells.

    Attributes
    ----------
    title : str
        The name of the result.
    report : mapping
        Of `Surface.report`, or what ``check`` or ``print`` found.
    scene : Scene
    summary : sequence of str
        What the command line says at its end.
    command : str
        The command that repeats it; empty where there is none.
    problems : sequence of Problem
    pictures : mapping
        Name, as of `tomomesh.show.gallery.draw_all`, to the bytes of a PNG file.
    histogram : Histogram or None
    frame : str
        What the numbers of places are, in words.
    """

    title: str
    report: Mapping[str, Any]
    scene: Scene
    summary: Sequence[str] = ()
    command: str = ""
    problems: Sequence[Problem] = ()
    pictures: Mapping[str, bytes] = field(default_factory=dict)
    histogram: Histogram | None = None
    frame: str = "millimeters"


def document(told: Contents) -> str:
    """Return a result as HTML: one file that needs no other, no server and no network.

    Parameters
    ----------
    told : Contents

    Returns
    -------
    str
        The same for the same contents; without script it is read all the same, and without WebGL a picture stands in
        for the 3-D view.
    """
    drawn, left_out = pictures_of(told.pictures)
    return page(
        "report.html.jinja",
        styles=[asset("viewer.css"), asset("style.css")],
        scripts=[three_js(), asset("viewer.js"), asset("tables.js"), asset("report.js")],
        told=told,
        verdict=verdict_of(told.report),
        worst=PROBLEM,
        shaded=_named(drawn, SHADED),
        pictures=[one for one in drawn if one.name != SHADED],
        left_out=left_out,
        tables=tables_of(told.report),
        citations=citations(__version__),
        version=__version__,
    )


def _named(drawn: Sequence[Picture], name: str) -> Picture | None:
    return next((one for one in drawn if one.name == name), None)
