"""Studies that are worked on slab by slab, and whether their meshes are those of the run in memory."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from tomomesh.large import LargeSurface

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from tomomesh.results import Surface

MEMORY: dict[str, Any] = {"remesh": False, "divide": False}
"""What the run in memory leaves out for the same bytes."""


def blobs(seed: int, shape: tuple[int, int, int] = (22, 16, 18)) -> NDArray[np.int16]:
    """Return smooth noise on background."""
    levels = np.random.default_rng(seed).normal(size=shape)
    for axis in range(3):
        levels = levels + np.roll(levels, 1, axis) + np.roll(levels, -1, axis)
    return np.round(40 * levels).astype(np.int16)


def same(large: LargeSurface | Surface, whole: Surface) -> bool:
    mesh = large.joined() if isinstance(large, LargeSurface) else large.mesh
    return (mesh.vertices.tobytes(), mesh.faces.tobytes()) == (
        whole.mesh.vertices.tobytes(),
        whole.mesh.faces.tobytes(),
    )
