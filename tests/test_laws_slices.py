"""Laws of stacks of contours: order, threads and place in space change nothing."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from conftest import law, seeds, size
from tomomesh.contours.assembly import MARGIN
from tomomesh.contours.curves import DENSE, field_of, fine_curve, moments_of
from tomomesh.contours.rings import outline
from tomomesh.contours.slices import find_slices
from tomomesh.contours.stack import contour_surface
from tomomesh.measure.topology import check_promise

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Floats = NDArray[np.float64]

EDGE = size(1.0, 4.0)


@st.composite
def curves(draw: st.DrawFn) -> Floats:
    """Draw a smooth closed curve around the origin, sampled about a millimeter apart."""
    rng = np.random.default_rng(draw(seeds))
    waves = draw(st.integers(2, 4))
    turn = np.linspace(0, 2 * np.pi, draw(st.integers(90, 150)), endpoint=False)
    radius = 18 + rng.uniform(0, 4) * np.cos(waves * turn + rng.uniform(0, 6))
    return np.column_stack([radius * np.cos(turn), radius * np.sin(turn)])


@st.composite
def stacks(draw: st.DrawFn) -> Floats:
    """Draw a stack of such curves that turns and moves from slice to slice."""
    curve, slope, turn = draw(curves()), draw(st.floats(0, 0.8)), draw(st.floats(-0.15, 0.15))
    rings = []
    for k in range(draw(st.integers(3, 6))):
        cosine, sine = np.cos(turn * k), np.sin(turn * k)
        moved = curve @ np.array([[cosine, sine], [-sine, cosine]]) + [slope * 5 * k, 0]
        rings.append(np.column_stack([moved, np.full(len(curve), 5.0 * k)]))
    return np.concatenate(rings)


@law(8)
@given(stacks(), seeds)
def test_order_repetitions_and_threads_change_no_byte(points: Floats, seed: int) -> None:
    rng = np.random.default_rng(seed)
    shuffled = np.concatenate([points, points[rng.integers(len(points), size=20)]])[rng.permutation(len(points) + 20)]
    made = []
    for cloud, threads in ((points, 1), (points, 2), (rng.permutation(points), 2), (shuffled, 1)):
        slices = find_slices(cloud)
        assert slices is not None
        made.append(contour_surface(cloud, slices, edge=EDGE, threads=threads).mesh)
    assert len({mesh.vertices.tobytes() + mesh.faces.tobytes() for mesh in made[:3]}) == 1
    assert made[3].faces.shape == made[0].faces.shape


@law(8)
@given(stacks(), seeds)
def test_a_stack_closes_wherever_it_lies(points: Floats, seed: int) -> None:
    rng = np.random.default_rng(seed)
    turn = np.linalg.qr(rng.normal(size=(3, 3)))[0]
    volumes = []
    for cloud in (points, points @ turn.T + rng.uniform(-1000, 1000, 3)):
        slices = find_slices(cloud)
        assert slices is not None
        made = contour_surface(cloud, slices, edge=EDGE)
        check_promise(made.mesh)
        volumes.append(made.mesh.face_volumes.sum())
    assert abs(volumes[1] / volumes[0] - 1) < size(0.005, 0.02)


@law(20)
@given(curves(), seeds)
def test_an_outline_is_the_curve_in_any_order(curve: Floats, seed: int) -> None:
    order = np.random.default_rng(seed).permutation(len(curve))
    found = outline(curve[order])
    assert len(found.rings) == 1
    ring = order[found.rings[0]]
    np.testing.assert_array_equal(np.roll(ring, -int(np.argmin(ring))), np.arange(len(curve)))


@law(20)
@given(curves(), st.floats(-0.5, 0.5), st.floats(-0.5, 0.5))
def test_distances_are_those_to_the_curve(curve: Floats, x: float, y: float) -> None:
    center = np.array([x, y])
    fine = fine_curve(curve, DENSE)
    field = field_of([fine], center, 1.0, MARGIN)
    rows, columns = np.mgrid[: field.values.shape[0], : field.values.shape[1]]
    pixels = np.stack([columns, rows], axis=-1) + field.low + center
    ahead = np.roll(fine, -1, axis=0) - fine
    step = pixels.reshape(-1, 1, 2) - fine
    share = np.clip((step * ahead).sum(axis=2) / (ahead**2).sum(axis=1), 0, 1)
    away = np.sqrt(((step - share[..., None] * ahead) ** 2).sum(axis=2).min(axis=1)).reshape(rows.shape)
    found = np.abs(field.values)
    assert np.abs(found - away)[away < 2].max() < 0.01
    assert np.abs(found - away).max() < 1.0
    inside = moments_of([fine]).area
    assert abs((field.values < 0).sum() / inside - 1) < 0.03
