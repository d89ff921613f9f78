"""Faces of a mesh in patches that pass through others, of the same patch or of those beside it."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ...measure.intersections import marked_in
from ...measure.links import Links
from ...measure.tree import Tree
from ...model.mesh import TriMesh
from .positions import heights_of

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from .patch import MeshPatch, Patches

    Floats = NDArray[np.float64]
    Lent = tuple[NDArray[np.int64], Floats]
    """Vertex numbers (h, 3) of faces in the whole mesh, and the positions (h, 3, 3) of their corners."""


def crossing_in(patches: Patches) -> NDArray[np.int64]:
    """Count the faces of every connected piece of every patch that pass through others, (p,).

    Faces that meet reach equal heights, so each patch is given those faces of others that reach into its own.
    """
    spans = np.reshape(patches.told(_span, [patches.along]), (len(patches), 2))
    lent = [_lent_to(patches, spans, one) for one in range(len(patches))]
    return np.concatenate([np.empty(0, np.int64), *patches.told(_crossing, lent)])


def _span(patch: MeshPatch, along: Sequence[float]) -> tuple[float, float]:
    """Return the least and the greatest height of a patch's faces."""
    heights = heights_of(patch.vertices, along)[patch.faces]
    return float(heights.min(initial=np.inf)), float(heights.max(initial=-np.inf))


def _lent_to(patches: Patches, spans: Floats, one: int) -> list[object]:
    """Ask the patches that reach into the heights of one for their faces there."""
    low, high = spans[one]
    others = np.flatnonzero((spans[:, 0] <= high) & (spans[:, 1] >= low) & (np.arange(len(spans)) != one))
    count, kept = len(others), [patches.kept[other] for other in others]
    return patches.slabs.each(_lent, kept, [low] * count, [high] * count, [patches.along] * count)


def _lent(patch: MeshPatch, low: float, high: float, along: Sequence[float]) -> Lent:
    heights = heights_of(patch.vertices, along)[patch.faces]
    some = patch.faces[(heights.min(axis=1) <= high) & (heights.max(axis=1) >= low)]
    return patch.numbers[some], patch.vertices[some]


def _crossing(patch: MeshPatch, lent: Sequence[Lent]) -> NDArray[np.int64]:
    """Count the faces of each connected piece of a patch that pass through its own or those that were lent to it."""
    own, links = len(patch.faces), Links(patch)
    if not own:
        return np.empty(0, np.int64)
    numbers = np.concatenate([patch.numbers[patch.faces], *(faces for faces, _ in lent)])
    corners = np.concatenate([patch.vertices[patch.faces], *(places for _, places in lent)])
    _, first, faces = np.unique(numbers, return_index=True, return_inverse=True)
    mesh = TriMesh(corners.reshape(-1, 3)[first], faces.reshape(-1, 3))
    crossing = marked_in(Tree.of_faces(mesh), np.arange(len(mesh.faces)) < own)[:own]
    return np.bincount(links.face_pieces[crossing], minlength=links.pieces).astype(np.int64)
