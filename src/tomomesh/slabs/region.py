"""The net of a slab and its halo, where it begins, and its steps to rest."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from ..isosurface.means import means
from ..isosurface.rings import Rings
from ..isosurface.settle import NetState, Springs, drawn_out, evened, moved
from ..isosurface.surface_nets import Net, net_of
from ..isosurface.thin import given_back
from .parts import Part, gathered
from .place import HALO

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from .frame import Frame
    from .parts import Arrays
    from .place import Place

    Floats = NDArray[np.float64]


@dataclass(frozen=True)
class Region:
    """The net of a slab and its halo, and its rings."""

    net: Net
    rings: Rings


def region(place: Place, cells: Sequence[Part], *, frame: Frame, threads: int = 1) -> Region:
    """Span the net of a slab and its halo."""
    held, cases = gathered(cells, *place.of_vertices)
    net = net_of(held, cases, frame.shape[1:], frame.lowest, threads, place.exact)
    rings = Rings.of(net, threads, place.vertices_around(HALO - 1))
    return Region(replace(net, links=np.empty((0, 6), np.int32)), rings)  # no step looks at them again


def rings_of(found: Region) -> Rings:
    """Return what steps alone look at."""
    return found.rings


def crossings_of(net: Net, shares: Sequence[NDArray[np.float64]]) -> Floats:
    """Return where levels cross the bounds (q, 3), half way where no shares (q,) are given."""
    return np.asarray(net.inner + (shares[0][:, None] if len(shares) else 0.5) * net.steps)


def begun(place: Place, found: Region, squares: Sequence[Part], *, springs: Springs) -> Part:
    """Return what a slab's own vertices are drawn to, and where they are then, (n, 3) each."""
    net, (_, *shares) = found.net, gathered(squares, *place.of_squares)
    borders, rows = crossings_of(net, shares), place.vertices_around
    goals = means(borders, net.fans, found.rings.threads, rows(HALO - 1))
    return _own(place, (goals, evened(goals, net.low, found.rings, springs, rows) if springs.evens else goals))


def returned(place: Place, found: Region, squares: Sequence[Part], parts: Sequence[Part], *, springs: Springs) -> Part:
    """Return what a slab's own vertices are drawn to (n, 3), drawn out where the mask is thin."""
    net, (thin, *shares) = found.net, gathered(squares, *place.of_squares)
    goals, places = gathered(parts, *place.of_vertices)
    rows, borders = place.vertices_around, crossings_of(net, shares)
    lengths = given_back(net, borders, thin, places, rows, place.squares_around, found.rings.threads)
    return _own(place, (drawn_out(goals, lengths, net, found.rings, springs, rows(0)),))


def put(place: Place, found: Region, parts: Sequence[Part], *, springs: Springs) -> Part:
    """Return what a slab's own vertices are drawn to, and where they would rest but for their cells, (n, 3) each."""
    (goals,) = gathered(parts, *place.of_vertices)
    return _own(place, (goals, evened(goals, found.net.low, found.rings, springs, place.vertices_around)))


def goals_of(place: Place, parts: Sequence[Part]) -> Floats:
    """Return what vertices are drawn to (n, 3), those of the halo too."""
    return gathered([replace(part, arrays=part.arrays[:1]) for part in parts], *place.of_vertices)[0]


def start_of(part: Part) -> Part:
    """Return where a slab's own vertices are at the beginning, and where they were before, (n, 3) each."""
    return replace(part, arrays=(part.arrays[1], part.arrays[1]))


def stepped(place: Place, rings: Rings, goals: Floats, parts: Sequence[Part], *, springs: Springs, steps: int) -> Part:
    """Take steps, of which no vertex that is looked at is too far from a slab's own; tells the longest (steps, 2)."""
    position, before = gathered(parts, *place.of_vertices)
    state, motions = NetState(position, before, goals), []
    for left in range(steps - 1, -1, -1):
        state, motion = moved(state, rings, springs, place.rows(left * springs.reach))
        motions.append(motion[:2])
    return replace(_own(place, (state.position, state.before)), told=np.array(motions))


def _own(place: Place, arrays: Arrays) -> Part:
    start, stop = place.vertices_around(0)
    return Part(place.of_vertices[0] + start, tuple(array[start:stop] for array in arrays))
