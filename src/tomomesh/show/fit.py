"""The history of a fit and of a training: how fast, how far, how much energy."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from matplotlib.ticker import MaxNLocator, NullLocator

from .marks import small_print
from .style import ACCENT, INK, MUTED, NETWORK, canvas, heading, styled

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from numpy.typing import NDArray

    from ..model.trace import Trace
    from ..som.history import History


@styled
def draw_fit(trace: Trace, *, tolerance: float | None = None, unit: str = "mm") -> Figure:
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
    figure, axes = canvas(9.2, 5.8, 2, 2)
    state = "converged" if trace.converged else "not converged"
    _curves(axes[0], {"speed": trace.speed, "acceleration": trace.acceleration}, log=True)
    if tolerance is not None:
        axes[0].axhline(tolerance, color=MUTED, linewidth=0.9, linestyle=":")
        small_print(axes[0], "tolerance", np.array([1, tolerance]), (0, 6), align="left")
    heading(axes[0], "Motion", f"largest over the vertices, cube edges; {state} in {len(trace.speed)} steps")
    _curves(axes[1], {"mean distance": trace.distance_mm})
    heading(axes[1], "Distance to the points", f"mean over the attracted vertices, {unit}")
    _curves(axes[2], {"kinetic": trace.kinetic, "potential": trace.potential}, log=True)
    heading(axes[2], "Energy", f"per unit of k_d, {unit}²")
    _curves(axes[3], {"clamped to one cube edge": trace.clamped, "without a point": trace.unattracted})
    axes[3].set_ylim(0, max(1.0, axes[3].get_ylim()[1]))
    axes[3].yaxis.set_major_locator(MaxNLocator(integer=True))
    heading(axes[3], "Vertices", "number of vertices held back or not attracted")
    for ax in axes[2:]:
        ax.set_xlabel("step")
    return figure


@styled
def draw_learning(history: History, *, unit: str = "") -> Figure:
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
    figure, axes = canvas(9.2, 3.1, 1, 3)
    ending = f", {unit}" if unit else ""
    _curves(axes[0], {"quantization error": history.quantization_error})
    heading(axes[0], "Quantization error", f"mean distance of an input to its winner{ending}")
    _curves(axes[1], {"largest move": history.largest_move}, log=True)
    heading(axes[1], "Largest move", f"of a neuron in an epoch{ending}")
    _curves(axes[2], {"radius": history.radius} | ({"learning rate": rate} if online else {}), log=online)
    heading(axes[2], "Radius" + (" and learning rate" if online else ""), "of the neighborhood, hops")
    for ax in axes:
        ax.set_xlabel("epoch")
    return figure


def _curves(ax: Axes, curves: dict[str, NDArray[np.generic]], *, log: bool = False) -> None:
    """Draw curves over the steps; a logarithmic axis leaves zeros out."""
    for (name, values), color in zip(curves.items(), (NETWORK, ACCENT), strict=False):
        heights = np.asarray(values, float)
        if log:
            heights = np.where(heights > 0, heights, np.nan)
        ax.plot(np.arange(1, len(heights) + 1), heights, color=color, label=name, marker="o", markersize=2.6)
    if log and any((np.asarray(values) > 0).any() for values in curves.values()):
        ax.set_yscale("log")
        ax.yaxis.set_major_formatter("{x:g}")
        ax.yaxis.set_minor_locator(NullLocator())
    else:
        ax.set_ylim(bottom=0)
    ax.grid(axis="y")
    ax.xaxis.set_major_locator(MaxNLocator(integer=True))
    if len(curves) > 1:
        ax.legend(loc="best", labelcolor=INK)
