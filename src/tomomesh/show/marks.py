"""The marks that pictures are made of: dots, lines, polygons and small print."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Literal

from matplotlib.collections import LineCollection, PolyCollection

from .style import ACCENT, MUTED

if TYPE_CHECKING:
    import numpy as np
    from matplotlib.axes import Axes
    from numpy.typing import NDArray

    Floats = NDArray[np.float64]


def dots(
    ax: Axes,
    places: Floats,
    *,
    size: float | Floats,
    color: Any,
    marker: str = "o",
    rim: Any = "none",
    width: float = 0.0,
) -> None:
    """Mark (n, 2) places; `size` is in square points."""
    ax.scatter(
        places[:, 0],
        places[:, 1],
        s=size,
        facecolors=color,
        marker=marker,
        edgecolors=rim,
        linewidths=width,
        zorder=3,
    )


def lines(ax: Axes, segments: Floats, *, color: str, width: float, style: str = "-") -> None:
    """Draw (n, 2, 2) segments over what was marked before them."""
    collection = LineCollection(list(segments), colors=color, linewidths=width, linestyles=style, zorder=3)
    ax.add_collection(collection)


def fill(ax: Axes, polygons: Floats, *, color: Any, edge: str = "face", width: float = 0.3) -> None:
    """Fill (n, 3 or 4, 2) polygons in their order; edges of their own color close the seams."""
    ax.add_collection(PolyCollection(polygons, facecolors=color, edgecolors=edge, linewidths=width))  # type: ignore[arg-type]


def small_print(
    ax: Axes,
    text: str,
    place: Floats,
    shift: tuple[float, float] = (0, 0),
    *,
    color: str = MUTED,
    align: Literal["left", "center", "right"] = "center",
) -> None:
    """Write a word beside an (x, y) place, shifted by points."""
    look: Any = {"textcoords": "offset points", "ha": align, "va": "center", "fontsize": 8, "zorder": 4}
    ax.annotate(text, (place[0], place[1]), shift, color=color, **look)


def arrow(ax: Axes, tail: Floats, tip: Floats, *, color: str = ACCENT, text: str = "", head: str = "-|>") -> None:
    """Point from one (x, y) place to another."""
    look: Any = {
        "arrowstyle": head,
        "color": color,
        "lw": 1.3,
        "mutation_scale": 12,
        "shrinkA": 8,
        "shrinkB": 3,
    }
    ax.annotate(text, (tip[0], tip[1]), (tail[0], tail[1]), color=color, ha="center", va="center", arrowprops=look)
