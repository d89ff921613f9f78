"""One look for all pictures: colors, letters, canvas and file."""

from __future__ import annotations

from functools import wraps
from os import PathLike
from typing import IO, TYPE_CHECKING, Any, ParamSpec, TypeVar

import matplotlib
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.colors import LinearSegmentedColormap
from matplotlib.figure import Figure
from matplotlib.layout_engine import ConstrainedLayoutEngine

from ..errors import OutputError

if TYPE_CHECKING:
    from collections.abc import Callable

    from matplotlib.axes import Axes

P = ParamSpec("P")
R = TypeVar("R")

INK, MUTED, RULE = "#17222b", "#66757f", "#d3dae0"
SIGNAL, NETWORK, ACCENT = "#b4bfc7", "#0b6b88", "#d9480f"
TRACKS = (NETWORK, "#8a4f9e", "#2e7d4f", "#a8791a", INK)
"""Contours of a slice, by their tracks."""
BONE = LinearSegmentedColormap.from_list("bone", ["#2c2420", "#86735f", "#cdbb9d", "#f7eedd"])
HEIGHT = LinearSegmentedColormap.from_list("height", ["#12345a", "#0b6b88", "#2fa58e", "#9ccb5b", "#f2c14e"])
RELIEF = LinearSegmentedColormap.from_list("relief", ["#3c6078", "#5a8ea0", "#a9cac8", "#f0e2c2", "#fffaf0"])
TINT = LinearSegmentedColormap.from_list("tint", ["#f6f8f9", "#a9cad4", "#0b6b88", "#0d2b45"])
DPI = 150

_RULES: Any = {
    "font.family": ["DejaVu Sans"],
    "font.size": 8.5,
    "text.color": INK,
    "axes.titlesize": 10,
    "axes.titleweight": "bold",
    "axes.titlelocation": "left",
    "axes.titlepad": 9,
    "axes.labelcolor": MUTED,
    "axes.edgecolor": MUTED,
    "axes.linewidth": 0.6,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.axisbelow": True,
    "grid.color": RULE,
    "grid.linewidth": 0.6,
    "xtick.color": MUTED,
    "ytick.color": MUTED,
    "xtick.major.width": 0.6,
    "ytick.major.width": 0.6,
    "xtick.major.size": 3,
    "ytick.major.size": 3,
    "legend.frameon": False,
    "legend.fontsize": 8.5,
    "lines.linewidth": 1.6,
}


def styled(draw: Callable[P, R]) -> Callable[P, R]:
    """Draw in the house style, whatever the caller has set."""

    @wraps(draw)
    def inside(*args: P.args, **kwargs: P.kwargs) -> R:
        with matplotlib.rc_context(_RULES):
            return draw(*args, **kwargs)

    return inside


def canvas(
    width: float, height: float, rows: int = 1, columns: int = 1, *, gap: float = 0.02
) -> tuple[Figure, list[Axes]]:
    """Open a figure of the given inches with a grid of panels, without a window."""
    layout = ConstrainedLayoutEngine(h_pad=0.09, w_pad=0.09, wspace=gap)
    inches = round(width * DPI) / DPI, round(height * DPI) / DPI
    figure = Figure(figsize=inches, dpi=DPI, layout=layout, facecolor="white")
    FigureCanvasAgg(figure)
    return figure, list(figure.subplots(rows, columns, squeeze=False).flat)


def heading(ax: Axes, title: str, note: str = "") -> None:
    """Title a panel, with a quieter line under the title."""
    ax.set_title(title, pad=20 if note else 9)
    if note:
        ax.annotate(
            note,
            (0, 1),
            xycoords="axes fraction",
            xytext=(0, 7),
            textcoords="offset points",
            color=MUTED,
            fontsize=8,
        )


def save(figure: Figure, file: str | PathLike[str] | IO[bytes]) -> None:
    """Write a figure as PNG; the same figure gives the same bytes.

    Raises
    ------
    OutputError
        Where the file cannot be written.
    """
    try:
        figure.savefig(file, format="png", metadata={"Software": None}, pil_kwargs={"compress_level": 4})
        figure.set_layout_engine("none")  # laid out again, panels beside scales would move by a fraction of a pixel
    except OSError as error:
        name = str(file) if isinstance(file, str | PathLike) else ""
        raise OutputError("the picture cannot be written", file=name, hint=str(error.strerror)) from error
