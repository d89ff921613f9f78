"""Find the gaps that a line of neurons bridges, and space its neurons evenly between them."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ..measure.polygon import along, evenly
from .inputs import median

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from ..model.lattice import Lattice


def bridged_edges(codebook: NDArray[np.float64], lattice: Lattice, bridge: float) -> NDArray[np.bool_]:
    """Tell which edges (e,) of a network are over `bridge` medians long: its "virtual lines" across gaps.

    None where `bridge` is 0.
    """
    ends = codebook[lattice.edges]
    off = ends[:, 1] - ends[:, 0]
    lengths = np.sqrt(np.einsum("ea,ea->e", off, off))
    return np.asarray((lengths > bridge * median(lengths)) & (bridge > 0))


def even_spacing(
    codebook: NDArray[np.float64], lattice: Lattice, gaps: NDArray[np.bool_]
) -> tuple[NDArray[np.float64], NDArray[np.bool_]]:
    """Slide the neurons of a chain or a ring along their own line until they are equally far apart.

    Neurons crowd where a band is thick. A gap stays as wide as it was: each arc between two gaps keeps its ends
    and gets neurons by its length; a ring without gaps keeps its first neuron.

    Parameters
    ----------
    codebook : (u, d) float array
    lattice : Lattice
        Any but a chain or a ring is returned as it is.
    gaps : (e,) bool array
        The edges that bridge a gap.

    Returns
    -------
    codebook : (u, d) float array
    gaps : (e,) bool array
        Where the gaps are now.
    """
    if lattice.name == "chain":
        return _even_arcs(codebook, gaps)
    if lattice.name != "ring":
        return codebook, gaps
    if not gaps.any():
        return evenly(np.concatenate([codebook, codebook[:1]]), len(codebook) + 1)[:-1], gaps
    shift = int(np.flatnonzero(gaps)[-1]) + 1
    turned, inner = _even_arcs(np.roll(codebook, -shift, axis=0), np.roll(gaps, -shift)[:-1])
    return np.roll(turned, shift, axis=0), np.roll(np.append(inner, True), shift)


def _even_arcs(line: NDArray[np.float64], gaps: NDArray[np.bool_]) -> tuple[NDArray[np.float64], NDArray[np.bool_]]:
    """Even out the runs of neurons between the gaps of an open line."""
    arcs = np.split(line, np.flatnonzero(gaps) + 1)
    if sum(along(arc)[-1] for arc in arcs) == 0:
        return line, gaps
    return even_arcs(arcs, len(line))


def even_arcs(arcs: Sequence[NDArray[np.float64]], count: int) -> tuple[NDArray[np.float64], NDArray[np.bool_]]:
    """Share neurons among open lines by their lengths, and place them evenly along each.

    Parameters
    ----------
    arcs : sequence of (p, d) float arrays
        Not all of length 0.
    count : int
        Neurons, one for each line at least.

    Returns
    -------
    neurons : (count, d) float array
    gaps : (count - 1,) bool array
        Whether the line ends between a neuron and the next.
    """
    lengths = np.array([along(arc)[-1] for arc in arcs])
    edges = count - len(arcs)
    share = edges * lengths / max(lengths.sum(), 1e-300)
    counts = np.floor(share).astype(int)
    counts[np.argsort(counts - share, kind="stable")[: edges - counts.sum()]] += 1
    gaps = np.zeros(count - 1, bool)
    gaps[np.cumsum(counts + 1)[:-1] - 1] = True
    return np.concatenate([evenly(arc, n + 1) for arc, n in zip(arcs, counts, strict=True)]), gaps
