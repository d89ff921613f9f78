"""Every slice with its networks and their measures, many to a page."""

from __future__ import annotations

from collections import Counter, defaultdict
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib.transforms import ScaledTranslation

from ..measure.rings import assess_contours
from ..model.networks import Networks
from .marks import lines
from .plane import PIXELS, Plane
from .render import nice_length
from .style import ACCENT, INK, MUTED, NETWORK, TRACKS, canvas, styled

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping

    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from numpy.typing import NDArray

    from ..model.contours import Contour, Contours

    Floats = NDArray[np.float64]

COLUMNS, ROWS = 6, 5
"""Slices of a page."""
BAR = 13
"""Points between the first slice and the scale bar above it."""
MOST_LINES = 3
"""Contours of a slice whose measures are written."""
PALE, PAPER = (217, 224, 230), (255, 255, 255)


@dataclass(frozen=True)
class Net:
    """A network of a slice: edges (e, 2, 2) in mm, those that bridge (e,), number of gaps, color and words."""

    edges: Floats
    bridged: NDArray[np.bool_]
    gaps: int
    color: str
    words: str


def draw_slices(mask: NDArray[np.bool_], found: Networks | Contours, plane: Plane = PIXELS) -> Iterator[Figure]:
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
    Figure
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


@styled
def _page(
    mask: NDArray[np.bool_],
    part: NDArray[np.intp],
    nets: Mapping[int, list[Net]],
    plane: Plane,
    bounds: Floats,
    which: str,
    note: str,
) -> Figure:
    width, height = bounds[1] - bounds[0]
    rows, columns = -(-len(part) // COLUMNS), min(len(part), COLUMNS)
    words = max((min(len(nets.get(int(k), ())), MOST_LINES + 1) for k in part), default=1)
    panel = 1.75 * float(np.clip(height / width, 0.4, 1.8)) + 0.22 + 0.12 * max(words, 1)
    figure, axes = canvas(1.75 * COLUMNS, rows * panel + 0.7, rows, columns, gap=0.01)
    for ax, k in zip(axes, part, strict=False):
        plane.draw(ax, np.where(mask[k][:, :, None], PALE, PAPER).astype(np.uint8))
        plane.crop(ax, bounds)
        _draw_nets(ax, nets.get(int(k), []), f"{k + 1}", empty=not mask[k].any())
    for ax in axes:
        ax.set_axis_off()
    scale_bar(axes[0], bounds, plane)
    figure.suptitle(which, x=0.01, ha="left", fontsize=10, fontweight="bold")
    figure.text(
        0.99,
        1 - 0.12 / figure.get_figheight(),
        f"{note}; dashed: bridged gaps",
        ha="right",
        va="top",
        color=MUTED,
        fontsize=8,
    )
    return figure


def _draw_nets(ax: Axes, nets: list[Net], number: str, *, empty: bool) -> None:
    """Draw the networks of a slice, and write under it what they measure."""
    for one in nets:
        lines(ax, one.edges[~one.bridged], color=one.color, width=0.9)
        lines(ax, one.edges[one.bridged], color=ACCENT, width=0.9, style="--")
    gaps = sum(one.gaps for one in nets)
    write_beside(ax, number, 0, 1.0, color=INK, weight="bold")
    if gaps:
        write_beside(ax, f"{gaps} gap{'' if gaps == 1 else 's'}", 1, 1.0, color=ACCENT)
    words = [(one.words, one.color) for one in nets[:MOST_LINES]]
    if len(nets) > MOST_LINES:
        words.append((f"and {len(nets) - MOST_LINES} more", MUTED))
    if not nets:
        words = [("no pixels" if empty else "no network", MUTED)]
    for n, (text, color) in enumerate(words):
        write_beside(ax, text, 0, -0.02, lines_down=n, color=color)


def write_beside(
    ax: Axes, text: str, x: float, y: float, *, lines_down: int = 0, color: str, weight: str = "normal"
) -> None:
    """Write above or under a slice, at its left or right end."""
    above = y > 0.5
    ax.annotate(
        text, (x, y), xycoords="axes fraction", xytext=(0, 1 if above else -8.5 * lines_down),
        textcoords="offset points", ha="right" if x else "left", va="bottom" if above else "top",
        color=color, fontsize=6.8, fontweight=weight,
    )  # fmt: skip


def scale_bar(ax: Axes, bounds: Floats, plane: Plane) -> None:
    """Put the length that all slices share above the first, where it hides none of it."""
    left, right = float(bounds[0, 0]), float(bounds[1, 0])
    length = nice_length(right - left)
    share = length / (right - left)
    look: Any = {"xycoords": "axes fraction", "textcoords": "offset points", "color": INK}
    above = ax.transAxes + ScaledTranslation(0, BAR / 72, ax.get_figure(root=True).dpi_scale_trans)
    ax.plot([0, share], [1, 1], color=INK, linewidth=1.6, transform=above, clip_on=False, solid_capstyle="butt")
    ax.annotate(f"{length:g} {plane.unit}".strip(), (share, 1), (4, BAR), va="center", fontsize=6.8, **look)
