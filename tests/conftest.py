"""Sizes, and the shapes whose truth is known."""

from __future__ import annotations

from typing import TYPE_CHECKING, TypeVar

import numpy as np
from hypothesis import HealthCheck, settings
from hypothesis import strategies as st
from numba.core import config

from tomomesh.model.cubes import CubeGrid, keys_of

if TYPE_CHECKING:
    from numpy.typing import NDArray

Number = TypeVar("Number", int, float)

COMPILED = not config.DISABLE_JIT
"""Whether the kernels run as machine code; where they do not, the tests are smaller."""


def size(compiled: Number, plain: Number) -> Number:
    """Return the first size for compiled kernels, the second for kernels in plain Python."""
    return compiled if COMPILED else plain


def law(examples: int) -> settings:
    """Try a law on a number of examples, the same every time."""
    few = size(examples, max(examples // 5, 3))
    slow = [HealthCheck.too_slow, HealthCheck.data_too_large]
    return settings(max_examples=few, deadline=None, derandomize=True, database=None, suppress_health_check=slow)


seeds = st.integers(0, 2**32 - 1)


@st.composite
def solids(draw: st.DrawFn, widest: int = 6) -> NDArray[np.bool_]:
    """Draw a grid (x, y, z) of cubes, some present, from sparse to crowded."""
    shape = draw(st.tuples(*[st.integers(1, widest)] * 3))
    rng = np.random.default_rng(draw(seeds))
    solid = rng.random(shape) < draw(st.sampled_from([0.08, 0.2, 0.5, 0.8, 0.95]))
    solid[tuple(rng.integers(shape))] = True
    return solid


def keys_in(solid: NDArray[np.bool_]) -> NDArray[np.int64]:
    """Return the rising keys of the cubes in a grid (x, y, z)."""
    return np.sort(keys_of(np.argwhere(solid)))


def cubes_of(
    keys: NDArray[np.int64], cell_mm: tuple[float, float, float] = (1.0, 1.0, 1.0), origin: float = 0.0
) -> CubeGrid:
    """Return a set of cubes without points."""
    none = np.zeros(0, np.int64)
    return CubeGrid(keys, np.full(3, origin), np.array(cell_mm), none, np.zeros(len(keys) + 1, np.int64))


def sphere(count: int, radius: float = 10.0) -> NDArray[np.float64]:
    """Spread points evenly over a sphere (Fibonacci's spiral)."""
    turn = np.arange(count) + 0.5
    z, angle = 1 - 2 * turn / count, np.pi * (3 - np.sqrt(5)) * turn
    flat = np.sqrt(1 - z**2)
    return radius * np.column_stack([flat * np.cos(angle), flat * np.sin(angle), z])


def torus(count: int, radius: float = 10.0, tube: float = 4.0) -> NDArray[np.float64]:
    """Spread points evenly over a torus: equal steps along, golden steps around, equal areas."""
    along = 2 * np.pi * (np.arange(count) * ((np.sqrt(5) - 1) / 2) % 1)
    fine = np.linspace(0, 2 * np.pi, 4096)
    area = radius * fine + tube * np.sin(fine)
    around = np.interp((np.arange(count) + 0.5) / count * area[-1], area, fine)
    ring = radius + tube * np.cos(around)
    return np.column_stack([ring * np.cos(along), ring * np.sin(along), tube * np.sin(around)])
