"""The triangles of a slab."""

from __future__ import annotations

from typing import TYPE_CHECKING

from ..isosurface.crossings import beyond_border
from ..isosurface.diagonals import diagonals, fours_of, of_triangles, placed, right_handed, split
from ..isosurface.surface_nets import steps_of
from .mesh import Piece
from .parts import Part, gathered
from .region import crossings_of

if TYPE_CHECKING:
    from collections.abc import Sequence

    import numpy as np
    from numpy.typing import NDArray

    from .place import Extent
    from .region import Region


def chosen(
    place: Extent, found: Region, squares: Sequence[Part], parts: Sequence[Part], *, rest: slice,
    affine: NDArray[np.float64],
) -> Part:  # fmt: skip
    """Choose the diagonals of a slab's own squares (q,); tells how many are split into four.

    Parameters
    ----------
    place, found, squares
        As in `tomomesh.slabs.region.begun`.
    parts : sequence of Part
    rest : slice
        The array of each part that says where vertices are.
    affine : (4, 4) float array
    """
    net, threads, (_, *shares) = found.net, found.rings.threads, gathered(squares, place.of_squares)
    (position,) = gathered(parts, place.of_vertices, rest)
    after, rows = placed(position, affine, threads), place.squares_around
    choice = diagonals(net, position, crossings_of(net, shares), after, rows, threads)
    start, stop = place.own_squares()
    own = choice[start:stop]
    return Part(place.of_squares[0] + start, (own,), len(fours_of(own)))


def piece(
    place: Extent, found: Region, squares: Sequence[Part], part: Part, choice: Part, first: int, *, rest: slice,
    affine: NDArray[np.float64], shape: tuple[int, ...],
) -> Piece:  # fmt: skip
    """Return a slab's piece of the mesh, of a volume of a shape; its first center has a number in it. See `chosen`."""
    net, threads, (_, *shares) = found.net, found.rings.threads, gathered(squares, place.of_squares)
    (start, stop), own, shift = place.own_squares(), choice.arrays[0], place.of_vertices[0]
    halves, quarters = split(net.quads[start:stop], own, right_handed(affine), first - shift, threads)
    fours = fours_of(own)
    centers = crossings_of(net, shares, start + fours)
    halves += shift
    beyond = beyond_border(net.inner[start:stop], steps_of(net.directions[start:stop]), shape)
    vertices, middles = (placed(indices, affine, threads) for indices in (*part.arrays[rest], centers))
    return Piece(vertices, middles, halves, quarters + shift, of_triangles(beyond, fours))
