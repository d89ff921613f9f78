"""Networks without an image: update regions (Fig. 1) and a network over a test region (Fig. 2)."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from matplotlib.collections import LineCollection
from matplotlib.colors import LinearSegmentedColormap

from ..model.lattice import lattice
from .camera import Camera
from .marks import arrow, dots, lines, small_print
from .style import ACCENT, INK, MUTED, NETWORK, RULE, SIGNAL, canvas, heading, styled

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from numpy.typing import NDArray

    from ..model.lattice import Lattice

FRONT = Camera()
SIGNAL_TO_NETWORK = LinearSegmentedColormap.from_list("depth", [SIGNAL, NETWORK])
"""From far to near."""


@styled
def draw_update_regions(neurons: int = 10, radius: int = 2, winner: int = 8, alpha: float = 0.4) -> Figure:
    """Draw which neurons follow an input in a chain and in a ring, and where they go (Fig. 1; eq. 2)."""
    figure, axes = canvas(8.4, 4.4, 1, 2)
    turn = np.pi * (0.5 - 2 * (np.arange(neurons) + 0.5) / neurons)
    places = np.stack([np.cos(turn), np.sin(turn)], axis=1)
    signal = 0.15 * places[winner]
    for letter, ax, name in zip("ab", axes, ("chain", "ring"), strict=True):
        network = lattice(name, neurons)
        near = network.hops[winner] <= radius
        _draw_update(ax, places, network, near, places + alpha * near[:, None] * (signal - places))
        dots(ax, signal[None], size=60, color=ACCENT, marker="X")
        small_print(ax, "input x(t)", signal, (0, -14), color=ACCENT)
        dots(ax, places[[winner]], size=430, color="none", rim=ACCENT, width=1.6)
        note = f"winner {winner + 1}, neighborhood of {radius}: {near.sum()} of {neurons} neurons move"
        heading(ax, f"{letter}  {name.capitalize()}", note)
    return figure


def _draw_update(
    ax: Axes,
    places: NDArray[np.float64],
    network: Lattice,
    near: NDArray[np.bool_],
    moved: NDArray[np.float64],
) -> None:
    lines(ax, places[network.edges], color=SIGNAL, width=1.2)
    lines(ax, moved[network.edges], color=NETWORK, width=1.6)
    dots(ax, places, size=230, color="white", rim=np.where(near, NETWORK, SIGNAL).tolist(), width=1.3)
    dots(ax, moved[near], size=34, color=NETWORK)
    for number, (place, moves) in enumerate(zip(places, near, strict=True), 1):
        small_print(ax, str(number), place, color=INK if moves else MUTED)
    for tail, tip in zip(places[near], moved[near], strict=True):
        arrow(ax, tail, tip, color=NETWORK, head="->")
    frame(ax)
    ax.set(xlim=(-1.3, 1.3), ylim=(-1.2, 1.2))


@styled
def draw_adapted(
    region: NDArray[np.float64],
    codebook: NDArray[np.float64],
    network: Lattice,
    *,
    start: NDArray[np.float64] | None = None,
    title: str = "A network over a region",
    camera: Camera = FRONT,
) -> Figure:
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
    figure, axes = canvas(4.3 * len(panels), 4.4, 1, len(panels))
    around = flat(np.concatenate([region, *(neurons for neurons, _ in panels)]), camera)
    for ax, (neurons, state) in zip(axes, panels, strict=True):
        dots(ax, flat(region, camera), size=5, color=SIGNAL)
        _draw_network(ax, neurons, network, camera)
        heading(ax, title, f"{network.name} of {len(network)} neurons, {state}")
        frame(ax)
        _limit(ax, around)
    return figure


def _draw_network(ax: Axes, neurons: NDArray[np.float64], network: Lattice, camera: Camera) -> None:
    """Draw a network; one in space from far to near, the nearer the larger and the stronger."""
    places, edges = flat(neurons, camera), network.edges
    if neurons.shape[1] != 3:
        lines(ax, places[edges], color=NETWORK, width=1.1)
        dots(ax, places, size=16, color=NETWORK, rim="white", width=0.5)
        return
    depth = camera.project(neurons)[:, 2]
    near = (depth - depth.min()) / (np.ptp(depth) or 1.0)
    order = np.argsort(near[edges].mean(axis=1), kind="stable")
    along = near[edges[order]].mean(axis=1)
    colors = np.asarray(SIGNAL_TO_NETWORK(along))
    ax.add_collection(LineCollection(list(places[edges[order]]), colors=colors, linewidths=0.5 + 1.3 * along, zorder=3))
    order = np.argsort(near, kind="stable")
    colors = np.asarray(SIGNAL_TO_NETWORK(near[order]))
    dots(ax, places[order], size=6 + 22 * near[order], color=colors, rim="white", width=0.5)


def _limit(ax: Axes, places: NDArray[np.float64]) -> None:
    """Give a panel the limits that all panels of a figure share."""
    low, high = places.min(axis=0), places.max(axis=0)
    margin = 0.05 * float((high - low).max() or 1.0)
    ax.set(xlim=(low[0] - margin, high[0] + margin), ylim=(low[1] - margin, high[1] + margin))


def flat(points: NDArray[np.float64], camera: Camera) -> NDArray[np.float64]:
    """Project (n, 3) points; leave (n, 2) points."""
    return camera.project(points)[:, :2] if points.shape[1] == 3 else points


def frame(ax: Axes) -> None:
    """Put a thin frame around a panel without axes."""
    ax.set_aspect("equal")
    ax.set_xticks([])
    ax.set_yticks([])
    for spine in ax.spines.values():
        spine.set(visible=True, color=RULE)
