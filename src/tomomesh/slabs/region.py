"""The net of a slab and its halo, where it begins, and its steps to rest."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from ..isosurface.means import means
from ..isosurface.rings import Rings
from ..isosurface.settle import NetState, Springs, drawn_out, evened, moved
from ..isosurface.surface_nets import Net, net_of, steps_of
from ..isosurface.thin import given_back
from .parts import Part, gathered
from .place import HALO

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from .frame import MaskFrame
    from .parts import Arrays
    from .place import Extent

    Floats = NDArray[np.float64]


LAST = slice(-1, None)


@dataclass(frozen=True)
class Region:
    """The net of a slab and its halo, and its rings."""

    net: Net
    rings: Rings


def region(place: Extent, cells: Sequence[Part], *, frame: MaskFrame, threads: int = 1) -> Region:
    """Span the net of a slab and its halo."""
    held, cases = gathered(cells, place.of_vertices)
    net = net_of(held, cases, frame.shape[1:], frame.lowest, threads, place.exact)
    rings = Rings.of(net, threads, place.vertices_around(HALO - 1))
    return Region(replace(net, links=np.empty((0, 6), np.int32)), rings)  # no step looks at them again


def crossings_of(net: Net, shares: Sequence[NDArray[np.float64]], rows: Any = slice(None)) -> Floats:
    """Return where levels cross the bounds (q, 3), of some squares; half way where no shares (q,) are given."""
    steps = steps_of(net.directions[rows])
    return np.asarray(net.inner[rows] + (shares[0][rows][:, None] if len(shares) else 0.5) * steps)


def begun(place: Extent, found: Region, squares: Sequence[Part], *, springs: Springs) -> Part:
    """Return what a slab's own vertices are drawn to (n, 3), and where they are then, if that is elsewhere."""
    net, (_, *shares) = found.net, gathered(squares, place.of_squares)
    rows = place.vertices_around
    goals = means(crossings_of(net, shares), net.fans, found.rings.threads, rows(HALO - 1))
    return _own(place, (goals, *([evened(goals, net.low, found.rings, springs, rows)] if springs.evens else [])))


def returned(
    place: Extent, found: Region, squares: Sequence[Part], own: Part, places: Sequence[Part], *, springs: Springs
) -> Part:
    """Return what a slab's own vertices are drawn to (n, 3), drawn out where the mask is thin.

    What they were drawn to is the first array of its own part, and where vertices are the last of all.
    """
    net, (thin, *shares) = found.net, gathered(squares, place.of_squares)
    (goals,), (position,) = gathered([own], place.of_vertices, slice(1)), gathered(places, place.of_vertices, LAST)
    rows, borders = place.vertices_around, crossings_of(net, shares)
    lengths = given_back(net, borders, thin, position, rows, place.squares_around, found.rings.threads)
    return _own(place, (drawn_out(goals, lengths, net, found.rings, springs, rows(0)),))


def put(place: Extent, found: Region, goals: Sequence[Part], *, springs: Springs) -> Part:
    """Return where a slab's own vertices would rest but for their cells, (n, 3)."""
    drawn, rows = goals_of(place, goals), place.vertices_around
    return _own(place, (evened(drawn, found.net.low, found.rings, springs, rows),))


def goals_of(place: Extent, parts: Sequence[Part]) -> Floats:
    """Return what vertices are drawn to (n, 3), those of the halo too: the first array of each part."""
    return gathered(parts, place.of_vertices, slice(1))[0]


def stepped(
    place: Extent, found: Region, goals: Floats, parts: Sequence[Part], *, springs: Springs, steps: int, begins: bool
) -> Part:
    """Take steps, of which no vertex that is looked at is too far from a slab's own.

    Parameters
    ----------
    place : Extent
    found : Region
    goals : (n, 3) float array
    parts : sequence of Part
        Where the vertices were before the last step, and where they are.
    springs : Springs
    steps : int
    begins : bool
        Whether there was no step before.

    Returns
    -------
    Part
        Where they were before the last of these steps, and are; tells the longest move and change in each, (steps, 2).
    """
    *earlier, position = gathered(parts, place.of_vertices, LAST if begins else slice(None))
    state, motions = NetState(position, earlier[0] if earlier else position.copy(), goals), []
    for left in range(steps - 1, -1, -1):
        state, motion = moved(state, found.rings, springs, place.rows(left * springs.reach))
        motions.append(motion[:2])
    return replace(_own(place, (state.before, state.position)), told=np.array(motions))


def _own(place: Extent, arrays: Arrays) -> Part:
    start, stop = place.vertices_around(0)
    return Part(place.of_vertices[0] + start, tuple(array[start:stop] for array in arrays))
