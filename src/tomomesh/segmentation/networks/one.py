"""The network of one slice of a study, looked at while it is trained: the one that the whole study has there."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from ...errors import EmptyError
from ...model.sliced import ranges
from ...progress import Progress, silent
from .training import train_some

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from ...model.lattice import Lattice
    from ...som.passes import Look
    from .slices import Slices

    Floats = NDArray[np.float64]

TOGETHER = 8
"""Slices below one that are trained together where each starts from the one below. No result depends on it."""


@dataclass(frozen=True)
class OneSlice:
    """A slice whose network is to be trained.

    Attributes
    ----------
    slices : Slices
        This slice alone.
    lattice : Lattice
        The network of every slice of its study.
    shown : (n, 2) or (n, 3) float array
        What the network sees, mm.
    below : (u, 2) float array or None
        The network that it starts from, where it starts from that of the slice below.
    """

    slices: Slices
    lattice: Lattice
    shown: Floats
    below: Floats | None = None

    @classmethod
    def of(cls, study: Slices, k: int, *, threads: int = 0, progress: Progress = silent) -> OneSlice:
        """Take slice `k` of a study.

        Raises
        ------
        EmptyError
            Where it has fewer inputs than a network needs: it has none in the study, too.
        """
        graph, one = study.network, study.part(k, k + 1)
        shown, least = one.shown(0), study.least(graph)
        if len(shown) < least:
            raise EmptyError(
                "the slice has pixels too few for a network", found=f"{len(shown)} pixels on slice {k}",
                expected=f"at least {least}", hint="a wider window, or fewer --neurons",
            )  # fmt: skip
        below = _below(study, k, graph, least, threads, progress) if study.settings.start == "neighbor" else None
        return cls(one, graph, shown, below)

    def train(self, look: Look) -> tuple[Floats, NDArray[np.bool_]]:
        """Train its network; return the neurons in pixels (u, 2), and which edges of the lattice bridge gaps."""
        fitted = self.slices.fitted(0, self.shown, self.lattice, self.below, look)
        return self.slices.spaced(fitted, self.lattice)


def _below(study: Slices, k: int, graph: Lattice, least: int, threads: int, progress: Progress) -> Floats | None:
    """Train the networks below a slice, one after the other, and return the last."""
    below = None
    for start, stop in ranges(0, k, TOGETHER):
        below = train_some(study.part(start, stop), graph, least, below, threads=threads).last
        progress("networks", stop, k)
    return below
