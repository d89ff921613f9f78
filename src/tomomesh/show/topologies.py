"""Networks without an image: update regions (Fig. 1) and a network over a test region (Fig. 2)."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ..model.lattice import lattice
from .camera import Camera
from .drawing.axes import around
from .drawing.marks import arrow, dots, lines, small_print
from .drawing.page import canvas
from .drawing.style import ACCENT, INK, MUTED, NETWORK, SIGNAL, WHITE, opaque, ramp

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from ..model.lattice import Lattice
    from .drawing.page import Page, Panel

FRONT = Camera()
SIGNAL_TO_NETWORK = ramp(SIGNAL, NETWORK)
"""From far to near."""


def draw_update_regions(neurons: int = 10, radius: int = 2, winner: int = 8, alpha: float = 0.4) -> Page:
    """Draw which neurons follow an input in a chain and in a ring, and where they go (Fig. 1; eq. 2)."""
    page, axes = canvas(8.4, 4.4, 1, 2)
    turn = np.pi * (0.5 - 2 * (np.arange(neurons) + 0.5) / neurons)
    places = np.stack([np.cos(turn), np.sin(turn)], axis=1)
    signal = 0.15 * places[winner]
    for letter, ax, name in zip("ab", axes, ("chain", "ring"), strict=True):
        ax.limit(-1.3, -1.2, 1.3, 1.2)
        around(ax)
        network = lattice(name, neurons)
        near = network.hops[winner] <= radius
        _draw_update(ax, places, network, near, places + alpha * near[:, None] * (signal - places))
        lines(ax, signal + 0.035 * np.array([[[-1, -1], [1, 1]], [[-1, 1], [1, -1]]]), color=ACCENT, width=2.4)
        small_print(ax, "input x(t)", signal, (0, -14), color=ACCENT)
        dots(ax, places[[winner]], size=20.7, rim=ACCENT, width=1.6)
        note = f"winner {winner + 1}, neighborhood of {radius}: {near.sum()} of {neurons} neurons move"
        ax.heading(f"{letter}  {name.capitalize()}", note)
    return page


def _draw_update(
    ax: Panel,
    places: NDArray[np.float64],
    network: Lattice,
    near: NDArray[np.bool_],
    moved: NDArray[np.float64],
) -> None:
    lines(ax, places[network.edges], color=SIGNAL, width=1.2)
    lines(ax, moved[network.edges], color=NETWORK, width=1.6)
    rims = np.where(near[:, None], opaque(NETWORK, 1), opaque(SIGNAL, 1))
    dots(ax, places, size=15.2, color=WHITE, rim=rims, width=1.3)
    dots(ax, moved[near], size=5.8, color=NETWORK)
    for number, (place, moves) in enumerate(zip(places, near, strict=True), 1):
        small_print(ax, str(number), place, color=INK if moves else MUTED)
    for tail, tip in zip(places[near], moved[near], strict=True):
        arrow(ax, tail, tip, color=NETWORK)


def draw_adapted(
    region: NDArray[np.float64],
    codebook: NDArray[np.float64],
    network: Lattice,
    *,
    start: NDArray[np.float64] | None = None,
    title: str = "A network over a region",
    camera: Camera = FRONT,
) -> Page:
    """Draw a network over the points that it was trained on (Fig. 2).

    Parameters
    ----------
    region : (n, 2) or (n, 3) float array
        The input signal.
    codebook : (u, 2) or (u, 3) float array
        Positions of the neurons.
    network : Lattice
        Which neurons are neighbors.
    start : (u, 2) or (u, 3) float array, optional
        Positions before the training, for a panel of their own.
    title : str
        What the region is.
    camera : Camera
        How points in space are looked at.
    """
    panels = [(start, "start")] if start is not None else []
    panels.append((codebook, "adapted"))
    page, axes = canvas(4.3 * len(panels), 4.4, 1, len(panels))
    limits = _limits(flat(np.concatenate([region, *(neurons for neurons, _ in panels)]), camera))
    for ax, (neurons, state) in zip(axes, panels, strict=True):
        ax.limit(*limits)
        dots(ax, flat(region, camera), size=2.2, color=SIGNAL)
        _draw_network(ax, neurons, network, camera)
        ax.heading(title, f"{network.name} of {len(network)} neurons, {state}")
        around(ax)
    return page


def _draw_network(ax: Panel, neurons: NDArray[np.float64], network: Lattice, camera: Camera) -> None:
    """Draw a network; one in space from far to near, the nearer the larger and the stronger."""
    places, edges = flat(neurons, camera), network.edges
    if neurons.shape[1] != 3:
        lines(ax, places[edges], color=NETWORK, width=1.1)
        dots(ax, places, size=4, color=NETWORK, rim=WHITE, width=0.5)
        return
    depth = camera.project(neurons)[:, 2]
    near = (depth - depth.min()) / (np.ptp(depth) or 1.0)
    order = np.argsort(near[edges].mean(axis=1), kind="stable")
    along = near[edges[order]].mean(axis=1)
    lines(ax, places[edges[order]], color=SIGNAL_TO_NETWORK(along), width=0.5 + 1.3 * along)
    order = np.argsort(near, kind="stable")
    size = (6 + 22 * near[order]) ** 0.5
    dots(ax, places[order], size=size, color=SIGNAL_TO_NETWORK(near[order]), rim=WHITE, width=0.5)


def _limits(places: NDArray[np.float64]) -> list[float]:
    """Return the limits that all panels of a figure share."""
    low, high = places.min(axis=0), places.max(axis=0)
    margin = 0.05 * float((high - low).max() or 1.0)
    return [*(low - margin), *(high + margin)]


def flat(points: NDArray[np.float64], camera: Camera) -> NDArray[np.float64]:
    """Project (n, 3) points; leave (n, 2) points."""
    return camera.project(points)[:, :2] if points.shape[1] == 3 else points
