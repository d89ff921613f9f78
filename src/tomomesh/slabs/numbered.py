"""What is known of the numbers of vertices and squares in the whole: prefix sums over the layers of all slabs."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from .parts import exchanged
from .place import HALO, Extent

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from .cuts import Cuts
    from .keep import Kept, Slabs

    Longs = NDArray[np.int64]


@dataclass(frozen=True)
class Numbered:
    """Slabs whose vertices and squares have their numbers in the whole.

    Attributes
    ----------
    layers : Cuts
    vertices, squares : (K + 1,) int64 array
        How many lie before each layer, and in all.
    slabs : Slabs
    """

    layers: Cuts
    vertices: Longs
    squares: Longs
    slabs: Slabs

    @classmethod
    def of(cls, layers: Cuts, counts: Sequence[Longs], slabs: Slabs) -> Numbered:
        """Add up how many each layer of each slab has, (2, l) each."""
        total = np.cumsum(np.concatenate(counts, axis=1), axis=1)
        vertices, squares = np.concatenate([np.zeros((2, 1), np.int64), total], axis=1)
        return cls(layers, vertices, squares, slabs)

    @property
    def places(self) -> list[Extent]:
        """Where the slabs lie."""
        return [Extent.of(self.layers, slab, self.vertices, self.squares) for slab in range(len(self.layers))]

    @property
    def first(self) -> tuple[list[int], list[int]]:
        """Numbers of each slab's first vertex and square."""
        starts = list(self.layers.places[:-1])
        return self.vertices[starts].tolist(), self.squares[starts].tolist()

    def exchanged(self, parts: Sequence[Kept]) -> list[tuple[Kept, ...]]:
        """Hand the slabs the vertices of their halos too."""
        return exchanged(self.slabs, parts, self.layers, self.vertices, HALO)

    def squares_exchanged(self, parts: Sequence[Kept]) -> list[tuple[Kept, ...]]:
        """Hand the slabs the squares of their halos too."""
        return exchanged(self.slabs, parts, self.layers, self.squares, HALO)
