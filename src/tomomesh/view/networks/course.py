"""The course of a training, kept for the page: every epoch of it, whatever the page has seen."""

from __future__ import annotations

import shlex
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from ...errors import UsageError
from ...segmentation.networks.slices import of_size
from ...settings import NetworkSettings, RunSettings, Settings
from ...som.inputs import Shown, flat
from ...som.passes import Look, at_times
from ...som.shapes import SHAPES

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping

    from numpy.typing import NDArray

    from ...model.lattice import Lattice
    from ...progress import Progress
    from ...show.plane import Plane

    Floats = NDArray[np.float64]

MOST = 5_000
"""Epochs that are kept, 5 MB of them for a ring of 58: more is no course that anybody looks at. Half or twice of it
changes no result."""
PICTURES = 60
"""Times that a network is looked at online, where an epoch is no pass over all inputs: as many frames as a film of
``tomomesh network --film`` has. Nothing depends on it."""


NOT_OF_REGIONS = ("way", "slices", "signal", "contours", "space")
"""Parameters that ``tomomesh network`` does not take: they are of studies."""


@dataclass(frozen=True)
class Backdrop:
    """What lies behind a network: a slice.

    Attributes
    ----------
    gray, kept : (J, I) uint8 arrays
        Its gray levels from black to white, and 1 where it is in the window.
    plane : Plane
    """

    gray: NDArray[np.uint8]
    kept: NDArray[np.uint8]
    plane: Plane


@dataclass(frozen=True)
class Moment:
    """A network at some time.

    Attributes
    ----------
    kind : str
        start, epoch, or spaced: how the run hands it on.
    codebook : (u, d) float array
        In pixels on a slice, else in the unit of the inputs.
    error : float
        Mean distance of an input to its winner, in the unit of the inputs.
    radius, alpha : float
    """

    kind: str
    codebook: Floats
    error: float
    radius: float
    alpha: float

    @property
    def told(self) -> dict[str, Any]:
        """What the page is told of it; numbers to the last bit."""
        return {
            "kind": self.kind, "codebook": self.codebook.ravel().tolist(), "neurons": len(self.codebook),
            "error": self.error, "radius": self.radius, "alpha": self.alpha,
        }  # fmt: skip


@dataclass
class TrainingCourse:
    """A training and what was seen of it.

    Attributes
    ----------
    title, note, unit : str
        What is trained, what there is to be said of it, and what lengths are in.
    source : dict
        What was asked for.
    settings : Settings
        What it is trained with.
    lattice : Lattice
        As many neurons as are handed on at the end.
    inputs : (n, d) float array
    scale : tuple of float
        What an input's coordinates are divided by to lie where the page draws them.
    backdrop : Backdrop or None
    frames : list of Moment
        The start first.
    bridged : (e,) bool array
        Edges of the lattice that bridge gaps, at the end.
    state : str
        running, done or stopped.
    """

    title: str
    source: Mapping[str, Any]
    settings: Settings
    lattice: Lattice
    inputs: Floats
    scale: tuple[float, ...]
    unit: str = ""
    note: str = ""
    backdrop: Backdrop | None = None
    frames: list[Moment] = field(default_factory=list)
    bridged: NDArray[np.bool_] | None = None
    state: str = "running"

    @property
    def dimensions(self) -> int:
        """Axes of the places that are drawn."""
        return len(self.scale)

    @property
    def places(self) -> Floats:
        """The inputs where they are drawn, (n, 2 or 3)."""
        return np.asarray(self.inputs[:, : self.dimensions] / self.scale)

    @property
    def command(self) -> str:
        """The command line that repeats it on a test region; "" elsewhere."""
        region = self.source.get("region")
        if region not in SHAPES:
            return ""
        network = replace(self.settings.network, **{name: getattr(NetworkSettings(), name) for name in NOT_OF_REGIONS})
        words = Settings(network=network, run=RunSettings(seed=self.settings.run.seed)).words()
        return shlex.join(["tomomesh", "network", str(region), *words])

    @property
    def stops(self) -> list[int]:
        """After how many epochs, or presentations online, each frame is, without those of the re-fit to no strays."""
        asked, count = self.settings.network, len(self.inputs)
        if asked.training == "batch":
            return list(range(1, asked.epochs + 1))
        if asked.least_move == 0 and count > 1:
            return [int(stop) for stop in at_times(asked.iterations, PICTURES)]
        return [*range(count, asked.iterations, count), asked.iterations]

    def told(self, first: int = 0) -> dict[str, Any]:
        """Tell the page of it, with the frames from one on."""
        bridged = [] if self.bridged is None else np.flatnonzero(self.bridged).tolist()
        plane = None if self.backdrop is None else _plane(self.backdrop)
        return {
            "title": self.title, "note": self.note, "unit": self.unit, "source": dict(self.source),
            "topology": self.lattice.name, "shape": list(self.lattice.shape), "neurons": len(self.lattice),
            "edges": self.lattice.edges.ravel().tolist(), "dimensions": self.dimensions, "inputs": len(self.inputs),
            "training": self.settings.network.training, "steps": [0, *self.stops],
            "plane": plane, "state": self.state, "count": len(self.frames), "bridged": bridged,
            "frames": [{"n": first + n, **one.told} for n, one in enumerate(self.frames[first:])],
        }  # fmt: skip

    def require_watchable(self) -> None:
        """Refuse more epochs than are kept.

        Raises
        ------
        UsageError
        """
        count, option = len(self.stops), "epochs" if self.settings.network.training == "batch" else "iterations"
        if count > MOST:
            raise UsageError(
                "more epochs than the page keeps", found=f"{count} of them", expected=f"at most {MOST}",
                hint=f"fewer --{option}",
            )  # fmt: skip

    def look(self, tell: Callable[[dict[str, Any]], None], progress: Progress) -> Look:
        """Return who looks on: keeps each epoch, tells the page of it, and stops where that is asked for."""
        shown, planned = Shown.of(self.inputs, None), len(self.stops)

        def told(codebook: Floats, done: int, radius: float, alpha: float) -> None:
            error = float(np.sqrt(shown.match(np.ascontiguousarray(flat(codebook).T))[1], dtype=np.float64).mean())
            drawn = np.asarray(codebook[:, : self.dimensions] / self.scale)
            self.add(Moment("epoch" if done else "start", drawn, error, radius, alpha), tell)
            progress("train", done, max(done, planned))  # last, so that a training that is stopped has its start

        return Look(told, 0 if len(self.inputs) == 1 else PICTURES)

    def add(self, frame: Moment, tell: Callable[[dict[str, Any]], None]) -> None:
        """Keep a frame, and tell the page of it."""
        self.frames.append(frame)
        tell({"event": "epoch", "n": len(self.frames) - 1, **frame.told})

    def end(self, codebook: Floats, bridged: NDArray[np.bool_] | None, tell: Callable[[dict[str, Any]], None]) -> None:
        """Keep what the run hands on, where the last epoch is not that already."""
        last, self.bridged, self.state = self.frames[-1], bridged, "done"
        if not np.array_equal(last.codebook, codebook):
            self.add(Moment("spaced", codebook, last.error, last.radius, last.alpha), tell)

    def network_of(self, frame: Moment) -> Lattice:
        """Return the network of a frame: a ring of fewer neurons where its slice has few inputs."""
        return of_size(self.lattice, len(frame.codebook))


def _plane(backdrop: Backdrop) -> dict[str, Any]:
    rows, columns = backdrop.gray.shape
    plane = backdrop.plane
    return {"rows": rows, "columns": columns, "spacing": list(plane.spacing_mm), "upward": plane.upward}
