"""Small label maps, and the walls between their labels."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from hypothesis import strategies as st
from hypothesis.extra import numpy as arrays

from conftest import COMPILED
from tomomesh import Volume
from tomomesh.isosurface.walls.walls import Walls, walls_between
from tomomesh.segmentation.labels import Labelled
from tomomesh.settings import Settings

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

    Solid = Callable[[Any], Any]

AFFINE = np.array([[-0.7, 0.0, 0.0, 10.3], [0.0, 0.8, 0.1, -77.1], [0.0, 0.0, 0.9, 3.33], [0.0, 0.0, 0.0, 1.0]])
FIT = Settings().fit
SLOW = pytest.mark.skipif(not COMPILED, reason="solids of 40 voxels, a minute each without the compiler")


@st.composite
def label_maps(draw: st.DrawFn) -> NDArray[Any]:
    """Draw small maps (K, J, I) with a label at least: blocks and single voxels of up to six, anywhere."""
    shape = draw(st.tuples(*[st.integers(1, 5)] * 3))
    labels = draw(st.sampled_from([(0, 3), (0, 1, 2), (0, 1, 2, 5, 7), (4, 6, 9), (-7, 0, 4, 11), (0, 1, 70_000)]))
    voxels = draw(arrays.arrays(np.int32, shape, elements=st.sampled_from(labels)))
    voxels[0, 0, 0] = labels[-1]
    for axis, times in enumerate(draw(st.tuples(*[st.integers(1, 3)] * 3))):
        voxels = np.repeat(voxels, times, axis=axis)
    return voxels


def labelled(voxels: NDArray[Any], affine: NDArray[np.float64] = AFFINE) -> Labelled:
    return Labelled.of(Volume.from_stored(voxels, affine))


def walls_of(voxels: NDArray[Any], affine: NDArray[np.float64] = AFFINE) -> Walls:
    return walls_between(labelled(voxels, affine), FIT)


def boundaries(walls: Walls) -> dict[int, Any]:
    """Return the boundary of each label that is left."""
    found = {int(number): walls.of(int(number)) for number in walls.block.numbers}
    return {number: one for number, one in found.items() if one is not None}


def triangles(mesh: Any) -> list[tuple[bytes, ...]]:
    """Return each triangle as its corners' bits, the least first, so that its turn is kept and its start is not."""
    corners = [[corner.tobytes() for corner in face] for face in mesh.vertices[mesh.faces]]
    return [tuple(face[first:] + face[:first]) for face in corners for first in [face.index(min(face))]]
