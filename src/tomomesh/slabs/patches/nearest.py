"""How far places are from a mesh in patches: the least of what its patches tell."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from ...measure.tree import Tree
from ...model.columns import for_kernels

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from ..keep import Kept
    from .patch import MeshPatch, Patches

    Floats = NDArray[np.float64]


@dataclass(frozen=True)
class PatchTrees:
    """The faces of every patch as a tree.

    Attributes
    ----------
    patches : Patches
    trees : list of Kept
    """

    patches: Patches
    trees: list[Kept]

    @classmethod
    def of(cls, patches: Patches) -> PatchTrees:
        """Build them."""
        return cls(patches, patches.each(_tree))

    def reach(self, places: Floats) -> Floats:
        """Return how far places (n, 3) are from the mesh, (n,)."""
        return np.asarray(np.min(self.patches.told(_reach, self.trees, [places]), axis=0))


def _tree(patch: MeshPatch) -> Tree | None:
    return Tree.over(patch.vertices, patch.faces) if len(patch.faces) else None


def _reach(_patch: MeshPatch, tree: Tree | None, places: Floats) -> Floats:
    if tree is None:
        return np.full(len(places), np.inf)
    simplices, boxes = for_kernels(tree.simplices, np.int32), for_kernels(tree.boxes, np.float64)  # as sent, read-only
    return Tree(for_kernels(tree.vertices, np.float64), simplices, tree.order, boxes).nearest(places)[0]
