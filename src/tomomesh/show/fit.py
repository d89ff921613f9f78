"""The history of a fit and of a training: how fast, how far, how much energy."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from .drawing.axes import SMALL, decades, legend, rule, ticks
from .drawing.letters import width as width_of
from .drawing.marks import dots, lines, small_print
from .drawing.page import canvas
from .drawing.style import ACCENT, MUTED, NETWORK

if TYPE_CHECKING:
    from collections.abc import Mapping

    from numpy.typing import NDArray

    from ..model.trace import Trace
    from ..som.history import History
    from .drawing.page import Page, Panel

    Floats = NDArray[np.float64]
    Curves = Mapping[str, NDArray[np.generic]]

COLORS = (NETWORK, ACCENT)
FINE = 8
"""Places of a step that a legend keeps off."""


def draw_fit(trace: Trace, *, tolerance: float | None = None, unit: str = "mm") -> Page:
    """Draw the trace of the dynamic mesh over its steps.

    Parameters
    ----------
    trace : Trace
        One entry a step.
    tolerance : float, optional
        Speed and acceleration at which the mesh rests, drawn as a line.
    unit : str
        The unit of the distances.
    """
    page, axes = canvas(9.2, 5.8, 2, 2, gap=0.25, left=0.5, below=0.42)
    state = "converged" if trace.converged else "not converged"
    motion = {"speed": trace.speed, "acceleration": trace.acceleration}
    _curves(axes[0], motion, log=True, level=("tolerance", tolerance))
    axes[0].heading("Motion", f"largest over the vertices, cube edges; {state} in {len(trace.speed)} steps")
    _curves(axes[1], {"mean distance": trace.distance_mm})
    axes[1].heading("Distance to the points", f"mean over the attracted vertices, {unit}")
    _curves(axes[2], {"kinetic": trace.kinetic, "potential": trace.potential}, log=True, along="step")
    axes[2].heading("Energy", f"per unit of k_d, {unit}²")
    vertices = {"clamped to one cube edge": trace.clamped, "without a point": trace.unattracted}
    _curves(axes[3], vertices, whole=True, along="step")
    axes[3].heading("Vertices", "number of vertices held back or not attracted")
    return page


def draw_learning(history: History, *, unit: str = "") -> Page:
    """Draw the course of a training over its epochs: error, moves, radius and, online, learning rate.

    Parameters
    ----------
    history : History
        Of one epoch at least.
    unit : str
        Of the inputs.
    """
    online = bool((history.alpha < 1).any())
    rate = np.where(history.alpha < 1, history.alpha, np.nan)  # the re-fit without strays is in batch
    page, axes = canvas(9.2, 3.1, 1, 3, gap=0.2, left=0.5, below=0.42)
    ending = f", {unit}" if unit else ""
    _curves(axes[0], {"quantization error": history.quantization_error}, along="epoch")
    axes[0].heading("Quantization error", f"mean distance of an input to its winner{ending}")
    _curves(axes[1], {"largest move": history.largest_move}, log=True, along="epoch")
    axes[1].heading("Largest move", f"of a neuron in an epoch{ending}")
    curves = {"radius": history.radius} | ({"learning rate": rate} if online else {})
    _curves(axes[2], curves, log=online, along="epoch")
    axes[2].heading("Radius" + (" and learning rate" if online else ""), "of the neighborhood, hops")
    return page


def _curves(
    ax: Panel, curves: Curves, *, log: bool = False, whole: bool = False, along: str = "",
    level: tuple[str, float | None] = ("", None),
) -> None:  # fmt: skip
    """Draw curves over the steps, and a level by its name; a logarithmic axis leaves zeros out."""
    heights = [np.asarray(values, np.float64) for values in curves.values()]
    name, at = level
    every = np.concatenate([*heights, [] if at is None else [at]])
    log = log and bool((every > 0).any())
    bottom, top, marked = _powers(every[every > 0]) if log else _from_zero(every, whole=whole)
    count = max(map(len, heights))
    ax.limit(1 - 0.03 * count, bottom, count + 0.03 * count, top, equal=False)
    words = [f"{value:g}" for value in 10.0**marked] if log else None
    rule(ax, along=along, x=ticks(1, count, 9, whole=True), y=marked, words=words, grid=True)
    places: list[Floats] = []
    if at is not None and (at > 0 or not log):
        line = np.log10(at) if log else at
        level_line = np.array([[[ax.limits[0], line], [ax.limits[2], line]]])
        lines(ax, level_line, color=MUTED, width=0.9, dashed=True)
        small_print(ax, name, np.array([1, line]), (0, 6), align=0)
        places.append(np.column_stack([np.arange(1, count + 1), np.full(count, line)]))
    for each, color in zip(heights, COLORS, strict=False):
        places.append(_places(each, log=log))
        sides, known = np.stack([places[-1][:-1], places[-1][1:]], axis=1), np.isfinite(places[-1][:, 1])
        lines(ax, sides[known[:-1] & known[1:]], color=color, width=1.6)
        dots(ax, places[-1][known], size=2.6, color=color)
    if len(curves) > 1:
        _name(ax, [*curves], np.concatenate(places))


def _places(heights: Floats, *, log: bool) -> Floats:
    """Return the places of a curve's steps, nothing where its height is none, (n, 2)."""
    shown = np.log10(np.where(heights > 0, heights, np.nan)) if log else heights
    return np.column_stack([np.arange(1, len(heights) + 1), shown])


def _powers(heights: Floats) -> tuple[float, float, Floats]:
    """Return the ends and the ticks of a logarithmic axis, as powers of ten."""
    low, high = np.log10(heights.min()), np.log10(heights.max())
    margin = max(0.05 * (high - low), 0.05)
    low, high = low - margin, high + margin
    return low, high, np.log10(decades(10**low, 10**high))


def _from_zero(heights: Floats, *, whole: bool) -> tuple[float, float, Floats]:
    """Return the ends and the ticks of an axis that begins at 0."""
    high = 1.05 * float(np.nanmax(heights, initial=0.0))
    high = max(high, 1.0) if whole else high or 1.0
    return 0.0, high, ticks(0.0, high, whole=whole)


def _name(ax: Panel, names: list[str], places: Floats) -> None:
    """Put a legend into the corner where the fewest steps are."""
    along = np.linspace(0, len(places) - 1, FINE * len(places))
    fine = np.stack([np.interp(along, np.arange(len(places)), column) for column in places.T], axis=1)
    seen, (left, top, right, bottom) = ax.place(fine), ax.box
    step = ax.page.points(13)
    wide = ax.page.points(14) + max(width_of(name, ax.page.points(SMALL)) for name in names)
    high = step * (len(names) - 1)
    corners = [(x, y) for y in (top + 0.6 * step, bottom - high - step) for x in (right - wide, left + step)]
    half = np.array([wide + 0.8 * step, high + 1.2 * step]) / 2
    middles = np.array(corners) + np.array([wide, high]) / 2
    hidden = [np.count_nonzero((np.abs(seen - middle) < half).all(axis=1)) for middle in middles]
    entries = [("-", color, name) for name, color in zip(names, COLORS, strict=False)]
    legend(ax.page, entries, corners[int(np.argmin(hidden))], stacked=True)
