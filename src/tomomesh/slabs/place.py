"""Where a slab and its halo lie among all layers, vertices and squares."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from ..isosurface.means import Rows, Span
    from .cuts import Cuts

    Longs = NDArray[np.int64]

HALO = 8
"""Layers of its neighbors' cells that a slab has on each side. Derived: seven are what the longest step between two
exchanges looks at, a Chebyshev series of six terms, or six averages; one more closes the squares at the rim. Twice as
many would halve the exchanges, and add a tenth to the cells of slabs of 64."""


@dataclass(frozen=True)
class Extent:
    """A slab's own layers of cells, and the numbers of its vertices and squares.

    Attributes
    ----------
    own : (int, int)
        Its layers, from the first to behind the last.
    layers : (int, int)
        Those and its halo, as far as there is any.
    vertices, squares : (l + 1,) int64 array
        Number of the first of each of these layers in the whole, and behind the last.
    """

    own: Span
    layers: Span
    vertices: Longs
    squares: Longs

    @classmethod
    def of(cls, cuts: Cuts, slab: int, vertices: Longs, squares: Longs) -> Extent:
        """Find the place of a slab, by how many vertices and squares lie before each layer and in all."""
        layers = cuts.around(slab, HALO)
        held = slice(layers[0], layers[1] + 1)
        return cls(cuts.own[slab], layers, vertices[held], squares[held])

    def vertices_around(self, layers: int) -> Span:
        """Return its own vertices and those within some layers, as rows of its arrays."""
        return self._rows(self.vertices, self.own[0] - layers, self.own[1] + layers)

    def rows(self, beyond: int) -> Rows:
        """Return what tells the vertices around its own and those within some layers."""
        return lambda layers: self.vertices_around(beyond + layers)

    def squares_around(self, layers: int) -> Span:
        """Return the squares around its own vertices, and those within some layers more, as rows of its arrays."""
        return self._rows(self.squares, self.own[0] - layers, self.own[1] + 1 + layers)

    def own_squares(self) -> Span:
        """Return its own squares as rows of its arrays."""
        return self._rows(self.squares, *self.own)

    def _rows(self, numbers: Longs, start: int, stop: int) -> Span:
        low, high = (min(max(layer, self.layers[0]), self.layers[1]) - self.layers[0] for layer in (start, stop))
        return int(numbers[low] - numbers[0]), int(numbers[high] - numbers[0])

    @property
    def exact(self) -> Span:
        """The first of its cells whose squares, and behind the last whose fans, lie within its halo or own layers."""
        return self.vertices_around(HALO - 1)

    @property
    def of_vertices(self) -> Span:
        """The number of its first vertex in the whole, that of its halo, and behind the last."""
        return int(self.vertices[0]), int(self.vertices[-1])

    @property
    def of_squares(self) -> Span:
        """The number of its first square in the whole, that of its halo, and behind the last."""
        return int(self.squares[0]), int(self.squares[-1])
