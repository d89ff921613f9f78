"""Open surfaces as one-sided sheets: the right number of borders, and the right Euler number."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pytest

from tomomesh import reconstruct_points
from tomomesh.errors import GeometryError
from tomomesh.measure.topology import check_promise

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Floats = NDArray[np.float64]


def on_sphere(count: int) -> Floats:
    x = np.random.default_rng(0).normal(size=(count, 3))
    return np.asarray(x / np.linalg.norm(x, axis=1, keepdims=True))


def half_sphere() -> Floats:
    x = on_sphere(12_000)
    return x[x[:, 2] > 0]


def tube() -> Floats:
    turn, height = np.random.default_rng(1).random((2, 8_000))
    return np.column_stack([np.cos(2 * np.pi * turn), np.sin(2 * np.pi * turn), 4 * height])


def square_with_holes() -> Floats:
    flat = 10 * np.random.default_rng(2).random((16_000, 2))
    away = np.min([np.hypot(*(flat - center).T) for center in ((3, 3), (7, 3), (5, 7))], axis=0)
    flat = flat[away > 1]
    return np.column_stack([flat, np.zeros(len(flat))])


def moebius() -> Floats:
    rng = np.random.default_rng(3)
    u, v = 2 * np.pi * rng.random(8_000), rng.uniform(-0.4, 0.4, 8_000)
    ring = 1 + v * np.cos(u / 2)
    return np.column_stack([ring * np.cos(u), ring * np.sin(u), v * np.sin(u / 2)])


class TestSheets:
    @pytest.mark.parametrize(
        ("cloud", "borders", "euler"),
        [(half_sphere(), 1, 1), (tube(), 2, 0), (square_with_holes(), 4, -2), (on_sphere(8_000), 0, 2)],
        ids=["half sphere", "tube", "square with holes", "sphere"],
    )
    def test_have_their_borders(self, cloud: Floats, borders: int, euler: int) -> None:
        surface = reconstruct_points(cloud, open=True)
        quality = surface.report["quality"]
        check_promise(surface.mesh, open_=True)
        assert (quality["boundary_loops"], quality["euler_number"]) == (borders, euler)
        assert quality["self_intersections"] == 0
        assert quality["points_to_surface_mean_mm"] < 0.02 * surface.report["points"]["spacing_mm"]

    def test_a_surface_of_one_side_is_refused(self) -> None:
        with pytest.raises(GeometryError, match="one side"):
            reconstruct_points(moebius(), open=True)

    def test_an_open_surface_is_recognised(self) -> None:
        with pytest.raises(GeometryError, match="--open"):
            reconstruct_points(half_sphere())
