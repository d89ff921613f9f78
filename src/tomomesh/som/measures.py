"""How well a network lies on its inputs, and how well it keeps neighbors neighbors, on its own graph."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
import scipy

from ..errors import UsageError
from ..kernels.som.neighborhoods import GAUSSIAN, weigh
from .inputs import Shown, flat
from .passes import match

if TYPE_CHECKING:
    from collections.abc import Iterator

    from numpy.typing import NDArray

    from ..model.lattice import Lattice

    Floats = NDArray[np.float64]

BLOCK = 1 << 20
"""Distances between inputs and neurons that are held at once: 8 MB. No result depends on it."""
LEAST = 1e-300
"""Least distance of two neurons that is divided by: neurons at one place have none."""


def network_measures(
    codebook: Floats, lattice: Lattice, inputs: Floats, *, weights: Floats | None = None, radius: float = 1.0
) -> dict[str, Any]:
    """Measure a network.

    Parameters
    ----------
    codebook : (u, d) float array
    lattice : Lattice
    inputs : (n, d) float array
    weights : (n,) float array, optional
        How much each input counts.
    radius : float
        Of the Gaussian neighborhood in the distortion, hops.

    Returns
    -------
    dict
        `dead_neurons`, `quantization_error`, `topographic_error`, `distortion`, `topographic_product`, and
        `trustworthiness` and `continuity` of `neighborhood_preservation`.
    """
    trust, continuity = neighborhood_preservation(codebook, lattice)
    return {
        "dead_neurons": dead_neurons(codebook, inputs, weights=weights),
        "quantization_error": quantization_error(codebook, inputs, weights=weights),
        "topographic_error": topographic_error(codebook, lattice, inputs, weights=weights),
        "distortion": distortion(codebook, lattice, inputs, radius=radius, weights=weights),
        "topographic_product": topographic_product(codebook, lattice),
        "trustworthiness": trust,
        "continuity": continuity,
    }


def quantization_error(codebook: Floats, inputs: Floats, *, weights: Floats | None = None) -> float:
    """Return the mean distance of an input to its winner.

    It does not measure a contour: neurons without any topology score better.
    """
    shown, m = _shown(codebook, inputs, weights)
    return float(np.average(np.sqrt(match(m, shown.by_axis)[1], dtype=np.float64), weights=shown.weights))


def dead_neurons(codebook: Floats, inputs: Floats, *, weights: Floats | None = None) -> int:
    """Count the neurons that win no input."""
    shown, m = _shown(codebook, inputs, weights)
    return int(len(codebook) - len(np.unique(match(m, shown.by_axis)[0])))


def topographic_error(codebook: Floats, lattice: Lattice, inputs: Floats, *, weights: Floats | None = None) -> float:
    """Return the share of inputs whose two nearest neurons are no neighbors on the graph (Kiviluoto 1996)."""
    shown, _ = _shown(codebook, inputs, weights)
    torn = [lattice.hops[tuple(_two_nearest(block).T)] > 1 for block in _squared(shown.inputs, flat(codebook))]
    return float(np.average(np.concatenate(torn), weights=shown.weights)) if len(lattice) > 1 else 0.0


def _two_nearest(squared: Floats) -> NDArray[np.intp]:
    first = squared.argmin(axis=1)
    others = squared.copy()
    others[np.arange(len(first)), first] = np.inf
    return np.column_stack([first, others.argmin(axis=1)])


def distortion(
    codebook: Floats, lattice: Lattice, inputs: Floats, *, radius: float = 1.0, weights: Floats | None = None
) -> float:
    """Return the mean over inputs of sum_i h(hops(c, i)) |x - m_i|^2, h a Gaussian (Heskes 1999)."""
    shown, _ = _shown(codebook, inputs, weights)
    by_hop = np.zeros(lattice.farthest + 1)
    weigh(by_hop, radius, 1.0, GAUSSIAN)
    sums = [
        (by_hop[lattice.hops[squared.argmin(axis=1)]] * squared).sum(axis=1)
        for squared in _squared(shown.inputs, flat(codebook))
    ]
    return float(np.average(np.concatenate(sums), weights=shown.weights))


def topographic_product(codebook: Floats, lattice: Lattice) -> float:
    """Compare the neurons' order on the graph with that among the inputs (Bauer & Pawelzik 1992).

        P = 1 / (u (u - 1)) sum_j sum_k ln( prod_(l <= k) Q1(j, l) Q2(j, l) ) / 2k

    Q1 divides the distance of neuron j to its l-th neighbor on the graph by that to its l-th neighbor among the
    inputs; Q2 is the same ratio of their hops. 0: the network has the dimension of its inputs; below: too few; above:
    too many. Of neurons at equally many hops the one that is nearer among the inputs comes first.

    Parameters
    ----------
    codebook : (u, d) float array
    lattice : Lattice
    """
    u = len(lattice)
    if u < 2:
        return 0.0
    apart = np.maximum(scipy.spatial.distance.cdist(codebook, codebook), LEAST)
    k = np.arange(1, u)
    total = 0.0
    for j, (distance, hops) in enumerate(zip(apart, lattice.hops, strict=True)):
        on_graph, among_inputs = _ranked(hops, distance, j), _ranked(distance, hops, j)
        ratio = np.log(distance[on_graph]) - np.log(distance[among_inputs])
        ratio += np.log(hops[on_graph]) - np.log(hops[among_inputs])
        total += float((np.cumsum(ratio) / (2 * k)).sum())
    return total / (u * (u - 1))


def neighborhood_preservation(
    codebook: Floats, lattice: Lattice, *, neighbors: int | None = None
) -> tuple[float, float]:
    """Return trustworthiness and continuity of the graph's neighborhoods (Venna & Kaski 2001), both 1 at best.

    Both are taken over the neurons, not over the inputs: inputs of one neuron are no hops apart. A network is
    trustworthy where the k neurons nearest on the graph are near among the inputs, and continuous the other way
    round; each wrong neighbor counts by how far down it ranks. Of neurons at equally many hops the one that is nearer
    among the inputs comes first.

    Parameters
    ----------
    codebook : (u, d) float array
    lattice : Lattice
    neighbors : int, optional
        k, under u / 2; by default the mean number of direct neighbors on the graph.

    Raises
    ------
    UsageError
        For another k.
    """
    u = len(lattice)
    k = neighbors if neighbors is not None else max(min(round(2 * len(lattice.edges) / u), (u - 1) // 2), 1)
    if not 1 <= k < max(u / 2, 2):
        raise UsageError("so many neighbors cannot be compared", found=f"{k}", expected=f"1 to under {u / 2:g}")
    apart = scipy.spatial.distance.cdist(codebook, codebook)
    lost = np.zeros(2)
    for j, (distance, hops) in enumerate(zip(apart, lattice.hops, strict=True)):
        orders = _ranked(hops, distance, j), _ranked(distance, hops, j)
        ranks = [np.empty(u, np.int64) for _ in orders]
        for rank, order in zip(ranks, orders, strict=True):
            rank[order] = np.arange(1, u)
        lost += [np.maximum(ranks[1 - way][orders[way][:k]] - k, 0).sum() for way in (0, 1)]
    worst = u * k * (2 * u - 3 * k - 1) / 2
    trust, continuity = 1 - lost / max(worst, 1)
    return float(trust), float(continuity)


def _ranked(first: NDArray[Any], second: NDArray[Any], own: int) -> NDArray[np.intp]:
    """Order all neurons but one by a first, then by a second number."""
    order = np.lexsort((second, first))
    return np.asarray(order[order != own])


def _shown(codebook: Floats, inputs: Floats, weights: Floats | None) -> tuple[Shown, Floats]:
    return Shown.of(inputs, weights), np.ascontiguousarray(flat(codebook).T)


def _squared(inputs: Floats, codebook: Floats) -> Iterator[Floats]:
    """Yield the squared distances of inputs to neurons, block by block."""
    step = max(BLOCK // len(codebook), 1)
    for n in range(0, len(inputs), step):
        yield scipy.spatial.distance.cdist(inputs[n : n + step], codebook, "sqeuclidean")
