"""Space the neurons of a line evenly, and find the gaps that it bridges."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from ..model.lattice import Lattice


def even_spacing(
    codebook: NDArray[np.float64], lattice: Lattice, *, bridge: float = 2.0
) -> NDArray[np.float64]:
    """Slide the neurons of a chain or a ring along their own line until they are equally far apart.

    Neurons crowd where a band is thick. A bridged gap stays as wide as it was: each arc between two gaps keeps
    its neurons and its ends, and a ring without gaps keeps its first neuron.

    Parameters
    ----------
    codebook : (u, d) float array
    lattice : Lattice
        Any but a chain or a ring is returned as it is.
    bridge : float
        Edges over this many medians are gaps; see `CubeSettings.bridge`.

    Returns
    -------
    (u, d) float array
    """
    if lattice.name not in ("chain", "ring"):
        return codebook
    edges = lattice.edges
    gaps = np.flatnonzero(bridged(codebook[edges[:, 1]] - codebook[edges[:, 0]], bridge))
    if lattice.name == "chain":
        return _even_arcs(codebook, gaps)
    if len(gaps) == 0:
        return _even(np.concatenate([codebook, codebook[:1]]))[:-1]
    shift = int(gaps[-1]) + 1
    turned = _even_arcs(np.roll(codebook, -shift, axis=0), (gaps[:-1] - shift) % len(codebook))
    return np.roll(turned, shift, axis=0)


def bridged(edges: NDArray[np.float64], bridge: float) -> NDArray[np.bool_]:
    """Tell which edge vectors (e, d) of a network are over `bridge` medians long; none where that is 0."""
    lengths = np.sqrt((edges**2).sum(axis=1))
    return np.asarray((lengths > bridge * np.median(lengths)) & (bridge > 0))


def _even_arcs(line: NDArray[np.float64], gaps: NDArray[np.int64]) -> NDArray[np.float64]:
    """Even out each run of neurons between the edges that are gaps."""
    return np.concatenate([_even(arc) for arc in np.split(line, np.sort(gaps) + 1)])


def _even(line: NDArray[np.float64]) -> NDArray[np.float64]:
    """Place as many points as a line has at equal steps along it, its ends kept."""
    along = np.concatenate([[0.0], np.cumsum(np.sqrt((np.diff(line, axis=0) ** 2).sum(axis=1)))])
    wanted = np.linspace(0.0, along[-1], len(line))
    return np.stack([np.interp(wanted, along, axis) for axis in line.T], axis=1)
