"""Every slice with its networks and their measures, many to a page."""

from __future__ import annotations

from collections import Counter, defaultdict
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from ..measure.rings import assess_contours
from ..model.networks import Networks
from .drawing.marks import lines
from .drawing.page import canvas
from .drawing.style import ACCENT, INK, MUTED, NETWORK, TRACKS
from .plane import PIXELS, Plane, on_paper
from .render import nice_length

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping

    from numpy.typing import NDArray

    from ..model.contours import Contour, Contours
    from .drawing.page import Page, Panel

    Floats = NDArray[np.float64]

COLUMNS, ROWS = 6, 5
"""Slices of a page."""
BAR = 13
"""Points between the first slice and the scale bar above it."""
LETTERS = 6.8
"""Points of the letters beside slices."""
MOST_LINES = 3
"""Contours of a slice whose measures are written."""
PALE = (217, 224, 230)


@dataclass(frozen=True)
class Net:
    """A network of a slice: edges (e, 2, 2) in mm, those that bridge (e,), number of gaps, color and words."""

    edges: Floats
    bridged: NDArray[np.bool_]
    gaps: int
    color: str
    words: str


def draw_slices(mask: NDArray[np.bool_], found: Networks | Contours, plane: Plane = PIXELS) -> Iterator[Page]:
    """Draw all slices with their networks, page by page.

    Chains and rings are told by their perimeter, their area and their longest edge over the median one; other
    networks by the last alone. All slices have one scale, and those between the first and the last that the window
    has pixels in are drawn, whether they have a network or not.

    Parameters
    ----------
    mask : (K, J, I) bool array
        The window.
    found : Networks or Contours
        One network a slice, or several.
    plane : Plane
        Spacing and sense of the slices.

    Yields
    ------
    Page
        `COLUMNS` x `ROWS` slices at most.
    """
    inside = np.flatnonzero(mask.any(axis=(1, 2)))
    if not len(inside):
        return
    nets, note = _nets(found, plane)
    ends = [one.edges.reshape(-1, 2) for row in nets.values() for one in row]
    bounds = _closer(plane.bounds(np.asarray(mask.any(axis=0)), np.concatenate([np.empty((0, 2)), *ends])))
    for part in pages(np.arange(inside[0], inside[-1] + 1)):
        which = f"Slices {part[0] + 1} to {part[-1] + 1} of {len(mask)}"
        yield _page(mask, part, nets, plane, bounds, which, note)


def pages(slices: NDArray[np.intp]) -> Iterator[NDArray[np.intp]]:
    """Yield the slices of each page."""
    for first in range(0, len(slices), COLUMNS * ROWS):
        yield slices[first : first + COLUMNS * ROWS]


def _closer(bounds: Floats) -> Floats:
    """Take half of the margin away: there are many slices on a page."""
    return np.asarray(bounds + 0.04 * np.array([[1.0], [-1.0]]) * (bounds[1] - bounds[0]).max())


def _nets(found: Networks | Contours, plane: Plane) -> tuple[Mapping[int, list[Net]], str]:
    """Return the networks of each slice, and what their measures are."""
    if not isinstance(found, Networks):
        return _of_lines(found, plane, closed=True), "each contour: perimeter, area, longest edge over the median edge"
    lattice = found.lattice
    if len(found.lines):
        closed, whose = lattice.name == "ring", f"{lattice.name} of {len(lattice)} neurons: "
        told = "perimeter, area, longest edge over the median edge" if closed else "length, longest over median edge"
        return _of_lines(found.lines, plane, closed=closed), whose + told
    return _of_sheets(found, plane), f"{lattice.name} of {len(lattice)} neurons: longest edge over the median edge"


def _of_lines(found: Contours, plane: Plane, *, closed: bool) -> Mapping[int, list[Net]]:
    nets: dict[int, list[Net]] = defaultdict(list)
    if not len(found):
        return nets
    measures = assess_contours(found, plane.spacing_mm, closed=closed)
    gaps = Counter((gap["slice"], gap["ring"]) for gap in measures["bridged_gaps"])
    each = measures["each"]
    for n, one in enumerate(found.contours):
        area = f"{each['area_mm2'][n]:,.0f} {plane.unit}²  " if closed else ""
        words = f"{each['perimeter_mm'][n]:,.0f} {plane.unit}  {area}{each['longest_over_median'][n]:.1f}x"
        edges, bridged = _sides(one, plane, closed=closed)
        color = TRACKS[one.track % len(TRACKS)]
        nets[one.slice].append(Net(edges, bridged, gaps[one.slice, one.ring], color, words))
    return nets


def _sides(one: Contour, plane: Plane, *, closed: bool) -> tuple[Floats, NDArray[np.bool_]]:
    places = plane.place(one.codebook)
    sides = np.stack([places, np.roll(places, -1, axis=0)], axis=1)
    count = len(places) if closed else len(places) - 1
    return sides[:count], one.bridged[:count]


def _of_sheets(found: Networks, plane: Plane) -> Mapping[int, list[Net]]:
    nets: dict[int, list[Net]] = {}
    for k, codebook, bridged in zip(found.slices, found.codebooks, found.bridged, strict=True):
        edges = plane.place(codebook)[found.lattice.edges]
        lengths = np.sqrt(((edges[:, 1] - edges[:, 0]) ** 2).sum(axis=1))
        words = f"{lengths.max() / max(np.median(lengths), 1e-300):.1f}x"
        nets[int(k)] = [Net(edges, bridged, int(bridged.sum()), NETWORK, words)]
    return nets


def _page(
    mask: NDArray[np.bool_],
    part: NDArray[np.intp],
    nets: Mapping[int, list[Net]],
    plane: Plane,
    bounds: Floats,
    which: str,
    note: str,
) -> Page:
    words = max((min(len(nets.get(int(k), ())), MOST_LINES + 1) for k in part), default=1)
    page, axes = contact_sheet(len(part), bounds, plane, which, f"{note}; dashed: bridged gaps", 0.12 * max(words, 1))
    for ax, k in zip(axes, part, strict=True):
        plane.draw(ax, on_paper(mask[k], PALE))
        _draw_nets(ax, nets.get(int(k), []), f"{k + 1}", empty=not mask[k].any())
    return page


def contact_sheet(
    count: int, bounds: Floats, plane: Plane, which: str, note: str, below: float = 0.0
) -> tuple[Page, list[Panel]]:
    """Open a page of panels for slices, of one scale, with a title, a note and a scale bar, and inches for words."""
    width, height = bounds[1] - bounds[0]
    rows, columns = -(-count // COLUMNS), min(count, COLUMNS)
    panel = 1.7 * float(np.clip(height / width, 0.4, 1.8)) + 0.2 + below
    wide = 1.75 * COLUMNS
    page, axes = canvas(
        wide, rows * panel + 0.7, rows, columns, gap=0.05, top=0.5, head=0.17, below=0.03 + below,
        right=(wide - 0.18) * (1 - columns / COLUMNS),
    )  # fmt: skip
    del axes[count:]
    for ax in axes:
        plane.crop(ax, bounds)
    high = 0.12 * page.dpi
    page.write(which, (high, high), size=10, up=1, strong=True)
    page.write(note, (page.pixels.shape[1] - high, high), align=1, up=1, color=MUTED, size=8)
    scale_bar(axes[0], bounds, plane)
    return page, axes


def _draw_nets(ax: Panel, nets: list[Net], number: str, *, empty: bool) -> None:
    """Draw the networks of a slice, and write under it what they measure."""
    for one in nets:
        lines(ax, one.edges[~one.bridged], color=one.color, width=0.9)
        lines(ax, one.edges[one.bridged], color=ACCENT, width=0.9, dashed=True)
    gaps = sum(one.gaps for one in nets)
    write_beside(ax, number, 0, above=True, color=INK, strong=True)
    if gaps:
        write_beside(ax, f"{gaps} gap{'' if gaps == 1 else 's'}", 1, above=True, color=ACCENT)
    words = [(one.words, one.color) for one in nets[:MOST_LINES]]
    if len(nets) > MOST_LINES:
        words.append((f"and {len(nets) - MOST_LINES} more", MUTED))
    if not nets:
        words = [("no pixels" if empty else "no network", MUTED)]
    for n, (text, color) in enumerate(words):
        write_beside(ax, text, 0, line=n, color=color)


def write_beside(
    ax: Panel, text: str, end: int, *, above: bool = False, line: int = 0, color: str, strong: bool = False
) -> None:
    """Write above a slice, or in a line under it, at its left (0) or right end (1)."""
    page = ax.page
    y = ax.box[1] - page.points(2) if above else ax.box[3] + page.points(3 + 8.5 * line)
    page.write(
        text, (float(ax.box[2 * end]), float(y)), size=LETTERS, color=color, align=end, up=0 if above else 1,
        strong=strong,
    )  # fmt: skip


def scale_bar(ax: Panel, bounds: Floats, plane: Plane) -> None:
    """Put the length that all slices share above the first, where it hides none of it."""
    length, page = nice_length(float(bounds[1, 0] - bounds[0, 0])), ax.page
    left, line = float(ax.box[0]), float(ax.box[1]) - page.points(BAR)
    ax.rule(np.array([[left, line], [left + length * ax.scale, line]]), 1.6, INK)
    place = (left + length * ax.scale + page.points(4), line)
    page.write(f"{length:g} {plane.unit}".strip(), place, size=LETTERS, up=0.5)
