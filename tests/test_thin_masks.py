"""What is a few voxels thin in a mask keeps its volume: the springs of its net may not take it away."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from conftest import law
from tomomesh import Volume, reconstruct
from tomomesh.isosurface.surface_nets import net_around
from tomomesh.isosurface.thin import DEPTH, thin_squares
from tomomesh.measure.topology import check_promise

if TYPE_CHECKING:
    from numpy.typing import NDArray

SIDE = 40


def places() -> NDArray[np.float64]:
    """Return the places (z, y, x) of a cube of voxels, counted from near its middle."""
    return np.asarray(np.moveaxis(np.indices((SIDE, SIDE, SIDE)), 0, -1) - np.array([19.6, 19.3, 19.9]))


def kept(mask: NDArray[np.bool_], stiffness: float = 0.25) -> float:
    """Return the share of its voxels' volume that a mask keeps."""
    volume = Volume.from_stored(mask.astype(np.uint8), np.eye(4))
    found = reconstruct(volume, select=(1,), way="voxels", stiffness=stiffness)
    mesh = found.mesh
    check_promise(mesh)
    assert found.report["fit"]["converged"]
    return float(mesh.face_volumes.sum()) / np.count_nonzero(mask)


@pytest.mark.parametrize("wide", [2, 3, 4])
def test_rods_along_an_axis(wide: int) -> None:
    mask = np.zeros((SIDE, SIDE, SIDE), bool)
    mask[6:34, 20 : 20 + wide, 20 : 20 + wide] = True
    assert 0.88 <= kept(mask) <= 1.02


@pytest.mark.parametrize("stiffness", [0, 1e-300, 1e-12, 1e-4, 0.003, 0.01, 0.02])
def test_soft_nets_keep_what_is_one_voxel_thin(stiffness: float) -> None:
    rod, leaf = np.zeros((2, 20, 20, 20), bool)
    rod[3:17, 9, 9] = leaf[9, 3:17, 3:17] = True
    assert 0.85 <= kept(rod, stiffness) <= 1.1
    assert 0.98 <= kept(leaf, stiffness) <= 1.02


@given(direction=st.tuples(*[st.floats(-1, 1)] * 3).filter(lambda d: np.linalg.norm(d) > 0.3), radius=st.floats(1.2, 3))
@law(8)
def test_rods_any_way(direction: tuple[float, float, float], radius: float) -> None:
    unit = np.array(direction) / np.linalg.norm(direction)
    along = places() @ unit
    mask = (((places() - along[..., None] * unit) ** 2).sum(axis=-1) < radius**2) & (np.abs(along) < 14)
    assert 0.85 <= kept(mask) <= 1.05


@pytest.mark.parametrize("normal", [(1.0, 0.2, 0.1), (0.4, 1.0, 0.3), (1.0, 1.0, 1.0), (0.0, 0.0, 1.0)])
def test_leaves_of_two_voxels(normal: tuple[float, float, float]) -> None:
    unit = np.array(normal) / np.linalg.norm(normal)
    mask = (np.abs(places() @ unit) < 1) & (np.abs(places()) < 14).all(axis=-1)
    assert 0.95 <= kept(mask) <= 1.02


@given(seed=st.integers(0, 2**32 - 1))
@law(20)
def test_thin_squares_are_those_with_background_behind(seed: int) -> None:
    mask = np.zeros((9, 8, 10), bool)
    mask[1:-1, 1:-1, 1:-1] = np.random.default_rng(seed).random((7, 6, 8)) < 0.8
    net, lit = net_around(mask), set(map(tuple, np.argwhere(mask)))
    for inner, step, found in zip(net.inner, net.steps, thin_squares(mask, net.inner + 1, net.steps), strict=True):
        behind = [tuple((inner + 1 - n * step)[::-1]) for n in range(1, DEPTH + 1)]
        assert found == (not all(min(one) >= 0 and one in lit for one in behind))
