"""A slice on its way from image to regions (Fig. 4-6)."""

from __future__ import annotations

from itertools import pairwise
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np
from matplotlib.colors import hsv_to_rgb
from matplotlib.patches import ConnectionPatch

from .marks import arrow, dots, lines
from .plane import PIXELS, Plane, contrast, gray, panels
from .style import ACCENT, NETWORK, heading, styled

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from numpy.typing import NDArray

    Pixels = NDArray[Any]
    Floats = NDArray[np.float64]

ON_DARK = "#ff9a4d"
PALE = (0.76, 0.80, 0.83)


@styled
def draw_window(image: Pixels, mask: Pixels, plane: Plane = PIXELS, *, note: str = "") -> Figure:
    """Draw a slice and what the window keeps of it (Fig. 4)."""
    levels = gray(image)
    figure, axes = panels(8.6, 2, plane.place(np.array(levels.shape[::-1])), 0.45)
    plane.draw(axes[0], levels, contrast(levels))
    heading(axes[0], "a  Slice", note or f"{levels.shape[1]} x {levels.shape[0]} pixels")
    # up to the brightest that is kept: what is dark in the slice shows too
    brightest = contrast(levels[mask] if mask.any() else levels)[1]
    plane.draw(axes[1], np.where(mask, levels, levels.min()), (levels.min(), brightest))
    heading(axes[1], "b  Window", f"{np.count_nonzero(mask):,} pixels kept")
    plane.rule(axes)
    return figure


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


@styled
def draw_regions(
    image: Pixels, mask: Pixels, codebook: Floats, network: Joined, labels: Pixels, plane: Plane = PIXELS
) -> Figure:
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
    labels : (J, I) int array
        0 outside, else the number of the nearest neuron plus one.
    plane : Plane
        Spacing and sense of the slice.
    """
    levels, places, inside = gray(image), plane.place(codebook), np.asarray(mask, float)
    bounds = plane.bounds(mask, places)
    figure, axes = panels(11.0, 4, bounds[1] - bounds[0], 0.4, gap=0.12)
    plane.draw(axes[0], levels, contrast(levels))
    plane.draw(axes[1], inside)
    plane.draw(axes[2], inside, (0, 3))
    lines(axes[2], places[network.edges], color=ON_DARK, width=0.9)
    dots(axes[2], places, size=9, color=ON_DARK)
    plane.draw(axes[3], _colored(labels, len(codebook)))
    heading(axes[0], "1  Image", "gray levels k")
    heading(axes[1], "2  Window", "k inside the limits")
    heading(axes[2], "3  Network", f"{network.name} of {len(network)} neurons")
    heading(axes[3], "4  Regions", "each pixel's nearest neuron")
    for ax in axes:
        ax.set_axis_off()
        plane.crop(ax, bounds)
    for left, right in pairwise(axes):
        _flow(figure, left, right)
    return figure


def _flow(figure: Figure, left: Axes, right: Axes) -> None:
    """Lead from one panel to the next."""
    step = ConnectionPatch((1.02, 0.5), (-0.02, 0.5), left.transAxes, right.transAxes, arrowstyle="-|>")
    step.set(mutation_scale=14, color=ACCENT, linewidth=1.6, in_layout=False)
    figure.add_artist(step)


def _colored(labels: Pixels, neurons: int) -> Floats:
    """Color the regions around the wheel, neighbors by turns lighter and darker, (J, I, 3)."""
    number = np.arange(neurons)
    wheel = np.stack([number / neurons, np.full(neurons, 0.62), np.where(number % 2, 0.95, 0.68)], axis=1)
    return np.asarray(np.vstack([np.zeros((1, 3)), hsv_to_rgb(wheel)])[np.asarray(labels, np.int64)])


@styled
def draw_contour(
    mask: Pixels, codebook: Floats, network: Joined, plane: Plane = PIXELS, *, bridged: NDArray[np.bool_]
) -> Figure:
    """Draw the network over the window, and alone with its bridged gaps (Fig. 6).

    `bridged` (e,) tells which edges of the network bridge a gap; the longest is pointed at.
    """
    places = plane.place(codebook)
    bounds, gaps = plane.bounds(mask, places), _longest_first(places, network.edges[bridged])
    figure, axes = panels(8.6, 2, bounds[1] - bounds[0], 0.3)
    plane.draw(axes[0], np.where(np.asarray(mask, bool)[:, :, None], PALE, 1.0))
    lines(axes[0], places[network.edges], color="black", width=0.9)
    dots(axes[0], places, size=15, color="black", marker="D")
    heading(axes[0], "a  Neurons and virtual lines", f"{network.name} of {len(network)} neurons over the window")
    dots(axes[1], places, size=20, color="white", rim=NETWORK, width=1.1)
    _mark(axes[1], places, gaps)
    found = {0: "no bridged gap", 1: "1 bridged gap"}.get(len(gaps), f"{len(gaps)} bridged gaps")
    heading(axes[1], "b  Neurons only", found)
    for ax in axes:
        plane.crop(ax, bounds)
    plane.rule(axes)
    return figure


def _longest_first(places: Floats, edges: NDArray[np.int64]) -> NDArray[np.int64]:
    length = np.sqrt(((places[edges[:, 0]] - places[edges[:, 1]]) ** 2).sum(axis=1))
    return edges[np.argsort(-length, kind="stable")]


def _mark(ax: Axes, places: Floats, gaps: NDArray[np.int64]) -> None:
    """Dash the gaps, and point at the longest from inside."""
    lines(ax, places[gaps], color=ACCENT, width=1.2, style="--")
    for gap in gaps[:1]:
        middle, center = places[gap].mean(axis=0), places.mean(axis=0)
        arrow(ax, middle + 0.32 * (center - middle), middle, text="gap")
