"""A slice on its way from image to regions (Fig. 4-6)."""

from __future__ import annotations

from itertools import pairwise
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np

from ..som.fit import match
from .drawing.marks import arrow, dots, lines, pointer
from .drawing.style import ACCENT, NETWORK, WHITE
from .plane import PIXELS, Plane, contrast, gray, on_paper, panels

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from .drawing.page import Page, Panel

    Pixels = NDArray[Any]
    Floats = NDArray[np.float64]

AXES = {"left": 0.5, "below": 0.42}
"""Inches for what axes say."""
ON_DARK, BLACK = "#ff9a4d", "#000000"
PALE = (194, 204, 212)


def draw_window(image: Pixels, mask: Pixels, plane: Plane = PIXELS, *, note: str = "") -> Page:
    """Draw a slice and what the window keeps of it (Fig. 4)."""
    levels = gray(image)
    page, axes = panels(8.6, 2, plane.place(np.array(levels.shape[::-1])), 0.55, **AXES)
    for ax in axes:
        plane.fit(ax, levels)
    plane.draw(axes[0], levels, contrast(levels))
    axes[0].heading("a  Slice", note or f"{levels.shape[1]} x {levels.shape[0]} pixels")
    # up to the brightest that is kept: what is dark in the slice shows too
    brightest = contrast(levels[mask] if mask.any() else levels)[1]
    plane.draw(axes[1], np.where(mask, levels, levels.min()), (levels.min(), brightest))
    axes[1].heading("b  Window", f"{np.count_nonzero(mask):,} pixels kept")
    plane.rule(axes)
    return page


class Joined(Protocol):
    """Whatever says how many neurons there are, what they form, and which are joined, as a lattice does."""

    @property
    def name(self) -> str:
        """What they form."""

    def __len__(self) -> int:
        """Return how many neurons there are."""

    @property
    def edges(self) -> NDArray[np.int64]:
        """Numbers (e, 2) of both neurons of each pair."""


def draw_regions(image: Pixels, mask: Pixels, codebook: Floats, network: Joined, plane: Plane = PIXELS) -> Page:
    """Draw the way of a slice: image, window, network, regions (Fig. 5).

    Parameters
    ----------
    image : (J, I) or (J, I, L) array
        Gray levels.
    mask : (J, I) bool array
        The window.
    codebook : (u, 2) float array
        Neurons in pixel indices (column, row).
    network : Joined
        Which neurons are neighbors.
    plane : Plane
        Spacing and sense of the slice.
    """
    levels, places, inside = gray(image), plane.place(codebook), np.asarray(mask, float)
    bounds = plane.bounds(mask, places)
    page, axes = panels(11.0, 4, bounds[1] - bounds[0], 0.4, gap=0.3)
    for ax in axes:
        plane.crop(ax, bounds)
    plane.draw(axes[0], levels, contrast(levels))
    plane.draw(axes[1], inside)
    plane.draw(axes[2], inside, (0, 3))
    lines(axes[2], places[network.edges], color=ON_DARK, width=0.9)
    dots(axes[2], places, size=3, color=ON_DARK)
    plane.draw(axes[3], _regions(mask, places, plane))
    axes[0].heading("1  Image", "gray levels k")
    axes[1].heading("2  Window", "k inside the limits")
    axes[2].heading("3  Network", f"{network.name} of {len(network)} neurons")
    axes[3].heading("4  Regions", "each pixel's nearest neuron")
    for left, right in pairwise(axes):
        _flow(page, left, right)
    return page


def _flow(page: Page, left: Panel, right: Panel) -> None:
    """Lead from one panel to the next."""
    middle = (left.box[1] + left.box[3]) / 2
    shift = 0.04 * page.dpi
    pointer(page, np.array([[left.box[2] + shift, middle], [right.box[0] - shift, middle]]), color=ACCENT)


def _regions(mask: Pixels, places: Floats, plane: Plane) -> Pixels:
    """Give each pixel of the window the color of its nearest neuron, (J, I, 3)."""
    rows, columns = np.nonzero(mask)
    pixels = plane.place(np.stack([columns, rows], axis=1))
    winners, _ = match(places, pixels)
    shown = np.zeros((*mask.shape, 3), np.uint8)
    shown[rows, columns] = _wheel(len(places))[winners]
    return shown


def _wheel(count: int) -> NDArray[np.uint8]:
    """Return colors around the wheel, neighbors by turns lighter and darker, (count, 3)."""
    number = np.arange(count)
    turns = 6 * (number[:, None] / count + np.array([0, 2 / 3, 1 / 3]))  # red, green and blue, a third apart
    colors = 1 - 0.62 * (1 - np.clip(np.abs(turns % 6 - 3) - 1, 0, 1))
    return np.asarray(np.round(255 * np.where(number % 2, 0.95, 0.68)[:, None] * colors).astype(np.uint8))


def draw_contour(
    mask: Pixels, codebook: Floats, network: Joined, plane: Plane = PIXELS, *, bridged: NDArray[np.bool_]
) -> Page:
    """Draw the network over the window, and alone with its bridged gaps (Fig. 6).

    `bridged` (e,) tells which edges of the network bridge a gap; the longest is pointed at.
    """
    places = plane.place(codebook)
    bounds, gaps = plane.bounds(mask, places), _longest_first(places, network.edges[bridged])
    page, axes = panels(8.6, 2, bounds[1] - bounds[0], 0.55, **AXES)
    for ax in axes:
        plane.crop(ax, bounds)
    plane.draw(axes[0], on_paper(mask, PALE))
    lines(axes[0], places[network.edges], color=BLACK, width=0.9)
    dots(axes[0], places, size=3.9, color=BLACK, marker="D")
    axes[0].heading("a  Neurons and virtual lines", f"{network.name} of {len(network)} neurons over the window")
    dots(axes[1], places, size=4.5, color=WHITE, rim=NETWORK, width=1.1)
    _mark(axes[1], places, gaps)
    found = {0: "no bridged gap", 1: "1 bridged gap"}.get(len(gaps), f"{len(gaps)} bridged gaps")
    axes[1].heading("b  Neurons only", found)
    plane.rule(axes)
    return page


def _longest_first(places: Floats, edges: NDArray[np.int64]) -> NDArray[np.int64]:
    length = np.sqrt(((places[edges[:, 0]] - places[edges[:, 1]]) ** 2).sum(axis=1))
    return edges[np.argsort(-length, kind="stable")]


def _mark(ax: Panel, places: Floats, gaps: NDArray[np.int64]) -> None:
    """Dash the gaps, and point at the longest from inside."""
    lines(ax, places[gaps], color=ACCENT, width=1.2, dashed=True)
    for gap in gaps[:1]:
        middle, center = places[gap].mean(axis=0), places.mean(axis=0)
        arrow(ax, middle + 0.32 * (center - middle), middle, text="gap")
