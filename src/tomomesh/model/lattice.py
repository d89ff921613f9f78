"""Network topologies: who is how many hops from whom (Fig. 1)."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from ..errors import UsageError

if TYPE_CHECKING:
    from numpy.typing import NDArray


@dataclass(frozen=True)
class Lattice:
    """A network of u neurons without positions.

    Attributes
    ----------
    name : str
        ``"chain"``, ``"ring"`` or ``"grid"``.
    edges : (e, 2) int array
        Pairs of direct neighbors.
    hops : (u, u) int32 array
        Fewest edges from one neuron to another: the one table behind every neighborhood.
    shape : tuple of int
        Neurons along each side.
    """

    name: str
    edges: NDArray[np.int64]
    hops: NDArray[np.int32]
    shape: tuple[int, ...]

    def __len__(self) -> int:
        return len(self.hops)

    @cached_property
    def nearest_first(self) -> NDArray[np.int32]:
        """All neurons in the order of their hops from each, (u, u)."""
        return np.argsort(self.hops, axis=1, kind="stable").astype(np.int32)

    @cached_property
    def within(self) -> NDArray[np.int32]:
        """How many neurons are at most 0, 1, 2, ... hops from each, itself among them, (u, h)."""
        counts = [(self.hops <= hop).sum(axis=1) for hop in range(int(self.hops.max()) + 1)]
        return np.stack(counts, axis=1).astype(np.int32)


def lattice(name: str, neurons: int) -> Lattice:
    """Build a topology of the given number of neurons.

    Parameters
    ----------
    name : {"chain", "ring", "grid"}
        A grid takes the two factors of `neurons` that are nearest to each other as its sides.
    neurons : int
        At least 3.

    Raises
    ------
    UsageError
        For a topology that there is not.
    """
    if name not in _BUILDERS:
        raise UsageError("there is no such network", found=f"--network = {name}", expected=" | ".join(_BUILDERS))
    return _BUILDERS[name](neurons)


def _chain(neurons: int) -> Lattice:
    node = np.arange(neurons)
    apart = np.abs(node[:, None] - node)
    return Lattice("chain", np.stack([node[:-1], node[1:]], axis=1), apart.astype(np.int32), (neurons,))


def _ring(neurons: int) -> Lattice:
    node = np.arange(neurons)
    apart = np.abs(node[:, None] - node)
    edges = np.stack([node, (node + 1) % neurons], axis=1)
    return Lattice("ring", edges, np.minimum(apart, neurons - apart).astype(np.int32), (neurons,))


def _grid(neurons: int) -> Lattice:
    rows = next(n for n in range(int(neurons**0.5), 0, -1) if neurons % n == 0)
    node = np.arange(neurons).reshape(rows, -1)
    row, column = np.divmod(np.arange(neurons), node.shape[1])
    apart = np.abs(row[:, None] - row) + np.abs(column[:, None] - column)
    across = np.stack([node[:, :-1].ravel(), node[:, 1:].ravel()], axis=1)
    down = np.stack([node[:-1].ravel(), node[1:].ravel()], axis=1)
    return Lattice("grid", np.concatenate([across, down]), apart.astype(np.int32), node.shape)


_BUILDERS = {"chain": _chain, "ring": _ring, "grid": _grid}
