"""What a notebook shows of a result: its summary in words, and the 3-D view in a frame that cannot reach the page.

The frame is sandboxed and carries its own page (HTML, 4.8.5), so that nothing is asked for and nothing of the notebook
is touched; it lies over a still picture, which is seen where scripts or frames are taken out, as of a notebook that is
not trusted.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from .. import __version__
from .index import SHOWN
from .page import asset, page
from .tables import in_words
from .three import three_js

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from .pictures import Picture
    from .scene import Scene

MOST = 40_000
"""Faces, or points, that a notebook shows. Chosen: the output takes 1.2 MB, of which three.js takes .7; twice of it
1.8, and a notebook keeps every output; of half, the ears of a head lose their edge."""


@dataclass(frozen=True)
class Shown:
    """What is told of a result.

    Attributes
    ----------
    title, words : str
        What it is, and what is to be said of it, in a sentence.
    facts : sequence of (str, str)
        Names and values.
    scene : Scene or None
        None where there is nothing to draw.
    frame : str
        What the numbers of places are, in words.
    still : Picture or None
        What it looks like.
    """

    title: str
    words: str
    facts: Sequence[tuple[str, str]]
    scene: Scene | None = None
    frame: str = "millimeters of the patient (LPS: to the left, to the back, up)"
    still: Picture | None = None


def inline(told: Shown) -> str:
    """Return a result as a piece of HTML that a notebook keeps and shows without a server.

    Parameters
    ----------
    told : Shown

    Returns
    -------
    str
        The same for the same contents.
    """
    framed = _framed(told) if told.scene is not None and three_js() else ""
    return page("inline.html.jinja", styles=[], scripts=[], told=told, framed=framed)


def in_markdown(told: Shown) -> str:
    """Return the words and facts alone, as Markdown: for paper, which shows no HTML."""
    rows = [f"| {name} | {value} |" for name, value in told.facts]
    return "\n".join([f"**{told.title}.** {told.words}", "", "| | |", "|---|---|", *rows, ""])


def facts_of(report: Mapping[str, Any], unit: str = "mm") -> list[tuple[str, str]]:
    """Return what is told first of a mesh: the way that it went, its counts and measures."""
    known: dict[str, Any] = {"warnings": len(report.get("warnings", ())), **report.get("quality", {})}
    length = "units" if unit == "unknown" else unit
    found = [(head.replace("mm", length), _number(known[key])) for key, head in SHOWN.items() if key in known]
    return [("way", report["way"]["name"]), *found] if "way" in report else found


def _number(value: Any) -> str:
    """Return a number as it is read, whole from a thousand on."""
    whole = isinstance(value, int) or (isinstance(value, float) and abs(value) >= 1000)
    return f"{value:,.0f}" if whole and not isinstance(value, bool) else in_words(value)


def _framed(told: Shown) -> str:
    """Return the page within the frame."""
    return page(
        "framed.html.jinja",
        styles=[asset("viewer.css"), asset("style.css")],
        scripts=[three_js(), asset("viewer.js"), asset("report.js")],
        told=told, shaded=told.still, version=__version__,
    )  # fmt: skip
