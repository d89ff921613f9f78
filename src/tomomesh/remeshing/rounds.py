"""Rounds of splits, collapses, flips and moves, until triangles are even and none pass through others."""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from ..measure.intersections import crossing_of
from ..measure.topology import with_equal_corners
from ..model.mesh import TriMesh
from .making import Making

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

    from ..progress import Progress
    from .ground import Ground

    Marks = NDArray[np.bool_]
    Made = tuple[TriMesh, NDArray[np.int32], Marks]
    """A mesh, the face of the surface before under each vertex, and the faces that pass through others or touch
    them at a vertex of their own."""

ROUNDS = 5
"""Most rounds of splits, collapses, flips and moves."""
FEW = 0.03
"""Splits and collapses a vertex in a round after which there is no other. Chosen: voxels' meshes take four rounds. With
three times as much they take three, which saves a tenth of the time and costs 0.5 degrees of the smallest angles (1 %).
"""
LAST = 1
"""Moves after the last round, each with flips."""
REPAIRS = 1.5, 0.5
"""Shares by which edges become longer, then shorter, where faces pass through others before their piece is made anew.
Chosen: longer edges, which take a fold away, help most often; 1.4 and 2 help as often."""
AIM = 0.97
"""Share of the most faces that is aimed at, for the number that a length of edges leads to varies by some percent."""
COARSER, ABOUT = 12, 4
"""Most rounds in which edges become longer until there are no more faces than asked for; or, where no number and no
length was, than before."""


def made_even(
    ground: Ground, kept: Marks, most: float, threads: int, progress: Progress, some: Marks | None = None
) -> Made:
    """Go round after round, and on with longer edges while there are too many faces; of `some` faces (m,) alone."""
    making = Making(ground, kept, threads, some)
    for count in range(ROUNDS):
        progress("remesh", count, ROUNDS + 1)
        if _round(making, split=count > 0) < FEW and count > 0:
            break
    _move(making, LAST)
    for count in range(COARSER if most < len(ground.faces) else ABOUT):
        if len(making.faces) <= most:
            break
        progress("remesh", ROUNDS + count, ROUNDS + COARSER)
        ground = ground.scaled((len(making.faces) / (AIM * most)) ** 0.5)
        making.rescaled(ground)
        _round(making)
        _move(making, LAST)
    making.lift()
    return _repaired(making, most, threads)


def _repaired(making: Making, most: float, threads: int) -> Made:
    """Where faces cross, put vertices back onto the surface before, then make edges longer, then shorter."""
    crosses = making.crossing()
    made, under = making.mesh()
    best = made, under, crosses
    resizes: list[Callable[[Making, Marks], Marks]] = [partial(_resize, share=share) for share in REPAIRS]
    for repair in (Making.lower, *resizes):
        if not crosses.any():
            break
        around = repair(making, crosses)
        made, under = making.mesh()
        crosses = _meeting(made, around, threads)
        if len(made.faces) > most:
            break
        if crosses.sum() < best[2].sum():
            best = made, under, crosses
    return best


def _meeting(mesh: TriMesh, some: Marks, threads: int) -> Marks:
    """Mark the faces (m,) that pass through `some` of them (m,), and those with two vertices at one position."""
    return crossing_of(mesh, some, threads=threads) | with_equal_corners(mesh.vertices, mesh.faces)


def _resize(making: Making, crosses: Marks, share: float) -> Marks:
    """Make edges longer or shorter at some faces (m,); return which faces have changed then."""
    with making.only_around(crosses, share) as changed:
        _round(making)
    return changed()


def made_anew(ground: Ground, kept: Marks, before: Made, most: float, threads: int, progress: Progress) -> Made:
    """Make those pieces anew of which faces pass through others, and leave the others as they are."""
    made, under, crosses = before
    piece = ground.pieces[under[made.faces[:, 0]]]
    again = np.zeros(int(ground.pieces.max()) + 1, np.bool_)
    again[piece[crosses]] = True
    left, used = made.faces[~again[piece]], np.zeros(len(made.vertices), np.bool_)
    used[left] = True
    other, below, _ = made_even(ground, kept, max(most - len(left), 1), threads, progress, again[ground.pieces])
    faces = np.concatenate([(np.cumsum(used) - 1)[left], other.faces + used.sum()])
    joined = TriMesh(np.concatenate([made.vertices[used], other.vertices]), faces)
    fresh = np.arange(len(faces)) >= len(left)
    return joined, np.concatenate([under[used], below]), _meeting(joined, fresh, threads)


def _round(making: Making, *, split: bool = True) -> float:
    """Change edges and move vertices; return the splits and collapses a vertex."""
    marks, before = making.marks(), int(making.counts[0])
    if split:
        marks = making.split(marks)
    changes = int(making.counts[0]) - before + making.collapse(marks)
    making.flip()
    making.move()
    return changes / making.vertices


def _move(making: Making, times: int) -> None:
    making.flip()
    for _ in range(times):
        making.move()
        making.flip()
