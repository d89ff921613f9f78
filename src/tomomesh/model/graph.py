"""A network as a graph: who is how many hops from whom (Fig. 1)."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from ..errors import UsageError

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray


@dataclass(frozen=True)
class Lattice:
    """A network of u neurons.

    Attributes
    ----------
    name : str
        A name that `tomomesh.model.lattice.lattice` knows, or ``"graph"``.
    edges : (e, 2) int array
        Pairs of direct neighbors.
    hops : (u, u) int32 array
        Fewest edges from one neuron to another: the one table behind every neighborhood.
    shape : tuple of int
        Neurons along each side.
    places : (u, k) float array
        Where the neurons lie when the network is at rest: about 0, each coordinate of about unit variance.
    faces : (m, 3) int array
        Triangles that make a closed network (a sphere, a torus) a surface, counterclockwise from outside; else
        none.
    """

    name: str
    edges: NDArray[np.int64]
    hops: NDArray[np.int32]
    shape: tuple[int, ...]
    places: NDArray[np.float64] = field(default_factory=lambda: np.empty((0, 1)))
    faces: NDArray[np.int64] = field(default_factory=lambda: np.empty((0, 3), np.int64))

    def __len__(self) -> int:
        return len(self.hops)

    def __repr__(self) -> str:
        """Return one line: the tables would fill pages."""
        sides = f"{' x '.join(map(str, self.shape))} = " if len(self.shape) > 1 else ""
        faces = f", {len(self.faces)} faces" if len(self.faces) else ""
        return f"<Lattice: {self.name} of {sides}{len(self)} neurons, {len(self.edges)} edges{faces}>"

    @cached_property
    def nearest_first(self) -> NDArray[np.int32]:
        """All neurons in the order of their hops from each, (u, u)."""
        return np.argsort(self.hops, axis=1, kind="stable").astype(np.int32)

    @cached_property
    def within(self) -> NDArray[np.int32]:
        """How many neurons are at most 0, 1, 2, ... hops from each, itself among them, (u, h)."""
        counts = [(self.hops <= hop).sum(axis=1) for hop in range(self.farthest + 1)]
        return np.stack(counts, axis=1).astype(np.int32)

    @cached_property
    def farthest(self) -> int:
        """Most hops between two neurons."""
        return int(self.hops.max(initial=0))


def lattice_of(edges: ArrayLike, neurons: int, *, name: str = "graph") -> Lattice:
    """Make a network of any connected graph.

    Parameters
    ----------
    edges : (e, 2) array of int
        Pairs of neurons; direction, loops and repetitions do not count.
    neurons : int
        At least 1; neurons are numbered from 0.
    name : str

    Raises
    ------
    UsageError
        For pairs that name no neurons, and for a graph in several pieces.
    """
    pairs = np.asarray(edges)
    if not (pairs.size == 0 or (pairs.ndim == 2 and pairs.shape[1] == 2 and np.issubdtype(pairs.dtype, np.integer))):
        raise UsageError("edges are pairs of neurons", found=f"shape = {pairs.shape}", expected="whole numbers (e, 2)")
    if neurons < 1 or (pairs.size and not 0 <= pairs.min() <= pairs.max() < neurons):
        raise UsageError("an edge names no neuron", found=f"{neurons} neurons", expected="numbers from 0, all below u")
    pairs = np.sort(pairs.reshape(-1, 2).astype(np.int64), axis=1)
    pairs = np.unique(pairs[pairs[:, 0] < pairs[:, 1]], axis=0)
    hops = hops_along(pairs, neurons)
    return Lattice(name, pairs, hops, (neurons,), scaled(_layout(hops)))


def hops_along(edges: NDArray[np.int64], neurons: int) -> NDArray[np.int32]:
    """Count the fewest edges from each neuron to each, breadth first, (u, u).

    Raises
    ------
    UsageError
        For a graph in several pieces.
    """
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import shortest_path

    links = coo_array((np.ones(len(edges)), (edges[:, 0], edges[:, 1])), shape=(neurons, neurons))
    paths = shortest_path(links.tocsr(), method="D", directed=False, unweighted=True)
    if not np.isfinite(paths).all():
        apart = int(np.isinf(paths[0]).sum())
        raise UsageError("the network is in pieces", found=f"{apart} neurons out of reach of the first", expected="one")
    return np.asarray(paths, np.int32)


def scaled(places: NDArray[np.float64]) -> NDArray[np.float64]:
    """Shift and stretch places to mean 0 and unit variance along each coordinate that has any."""
    off = places - places.mean(axis=0)
    spread = off.std(axis=0)
    return np.asarray(off / np.where(spread > 1e-12, spread, 1.0))


def _layout(hops: NDArray[np.int32]) -> NDArray[np.float64]:
    """Place neurons so that their distances are about their hops: classical scaling (Torgerson 1952), (u, k <= 3)."""
    from scipy.linalg import eigh

    u = len(hops)
    squared = hops.astype(np.float64) ** 2
    mean = squared.mean(axis=0)
    gram = (mean[:, None] + mean - squared - mean.mean()) / 2
    values, vectors = eigh(gram, subset_by_index=(max(u - 3, 0), u - 1))
    largest = np.abs(vectors).argmax(axis=0)
    forward = np.where(vectors[largest, np.arange(vectors.shape[1])] < 0, -1.0, 1.0)
    return np.asarray((vectors * forward * np.sqrt(np.maximum(values, 0.0)))[:, ::-1])
