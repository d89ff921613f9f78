"""What a way from data to a mesh is: a value, of which the rest of the program knows nothing more than this."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping

    from ..progress import Progress
    from ..results import Segmentation, Surface
    from ..segmentation.study import Selected
    from ..settings import Settings
    from ..stage import Stage

    Conditions = Mapping[str, tuple[str, ...]]
    Told = dict[str, Any]

INPUTS = {
    "gray": "on a gray study", "color": "on a color study", "cloud": "on a cloud", "stack": "on a stack of contours",
}  # fmt: skip
"""What is read, in words: a study, or points, which may be a stack of contours on parallel slices."""
POINTS = ("cloud", "stack")
"""Inputs that are no study."""


def no_lines(report: Told) -> list[str]:
    """Say nothing in the summary."""
    return []


def no_stages(found: Segmentation[Any]) -> dict[str, Any]:
    """Give nothing to the pictures but what every way does."""
    return {}


def nothing_more(settings: Settings) -> None:
    """Require nothing of the settings."""


@dataclass(frozen=True)
class Way:
    """A way from what is read to a mesh.

    Attributes
    ----------
    applies : callable
        Whether it is the way for these settings and this input: a key of `INPUTS`. Of several, the first in the table
        is taken.
    because : callable
        What took it there, in words that follow *has no effect*.
    reads : mapping
        The parameters of networks, cubes and fit that change anything on it, each with the values of other
        parameters that this takes.
    surface : callable
        From a `Segmentation`, or from `Points` where `segment` is None, to a surface.
    segment : callable, optional
        From what is kept of a study to points.
    require : callable
        Raises where the settings ask for what it cannot do, before any work.
    of_networks, of_body : callable
        Lines of the summary, before and after that of the points, from the report.
    pictures : callable
        What `tomomesh.show.draw_all` takes of a segmentation, besides what it takes of all.
    name : str
        Its own in the table, which `tomomesh.ways.way_of` gives it.

    Notes
    -----
    Its stages must tell, of the report, ``points`` with ``unit``, ``count`` and ``spacing_mm``, as
    `tomomesh.ways.sections.points_found` does; all else may be left out.
    """

    applies: Callable[[Settings, str], bool]
    because: Callable[[Settings, str], str]
    reads: Mapping[str, Conditions]
    surface: Callable[[Any, Settings, Progress], Stage[Surface]]
    segment: Callable[[Selected, Settings, Progress], Stage[Segmentation[Any]]] | None = None
    require: Callable[[Settings], None] = nothing_more
    of_networks: Callable[[Told], list[str]] = no_lines
    of_body: Callable[[Told], list[str]] = no_lines
    pictures: Callable[[Segmentation[Any]], dict[str, Any]] = no_stages
    name: str = ""


def on_input(settings: Settings, input: str) -> str:
    """Say what was read, as the reason for a way."""
    return INPUTS[input]


def parameters(*names: str, **conditions: Conditions) -> dict[str, Conditions]:
    """Name parameters that a way reads, and those that it reads beside certain values of others alone."""
    return {name: {} for name in names} | conditions


TRAINING = parameters(
    "inputs", "signal", "neurons", "training", "iterations", "epochs", "start", "neighborhood", "alpha", "alpha_fall",
    "alpha_power", "radius", "radius_fall", "radius_power", "least_move", "trim", "seed",
)  # fmt: skip
"""What every way reads that trains networks."""
CUBES = parameters("cell_mm", "cell_factor", "closing", "largest", "allow_leaks", "surface", "low_pass")
"""What every way reads that goes by cubes."""
SPRINGS = parameters("stiffness", "damping", "step", "springs", "limit", "allow_returns")
"""What every way reads whose mesh hangs on springs between masses."""
