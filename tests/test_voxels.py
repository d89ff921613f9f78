"""The window's own boundary as a surface: closed, in its cells, where the gray levels say, without a staircase."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy import ndimage

from conftest import composed, law, seeds, solids
from isosurfaces import ball, cubes_marched, mean_turn, volume_of
from studies import AFFINES
from tomomesh.isosurface import means, settle
from tomomesh.isosurface.crossings import CLOSEST
from tomomesh.isosurface.diagonals import _is_odd
from tomomesh.isosurface.settle import MARGIN, TENSION
from tomomesh.isosurface.voxels import Boundary, VoxelSurface, boundary, voxel_surface
from tomomesh.isosurface.well_composed import without_contacts
from tomomesh.measure.intersections import self_intersections
from tomomesh.measure.report import compare
from tomomesh.measure.topology import check_promise, topology
from tomomesh.model.mesh import TriMesh
from tomomesh.model.points import BORDER
from tomomesh.segmentation.window import window
from tomomesh.settings import FitSettings

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from tomomesh.model.volume import Volume

    Floats = NDArray[np.float64]

LEFT_HANDED = np.array([[0.7, 0.1, 0.0, 3.0], [0.0, -0.9, 0.2, -5.0], [0.1, 0.0, 2.0, 8.0], [0.0, 0.0, 0.0, 1.0]])
SHEARED = np.array([[0.6, 0.0, 0.0, 0.0], [0.0, 0.6, 0.9, 0.0], [0.0, 0.0, 2.0, 0.0], [0.0, 0.0, 0.0, 1.0]])


def surface_of(
    volume: Volume, lower: float = 0.0, upper: float = np.inf, *, settings: FitSettings | None = None, **kind: Any
) -> tuple[Boundary, VoxelSurface]:
    mask = window(volume, lower=lower, upper=upper)
    found = boundary(volume, mask, lower=lower, upper=upper, **kind)
    return found, voxel_surface(found, settings or FitSettings())


@st.composite
def levels(draw: st.DrawFn) -> NDArray[Any]:
    """Draw gray levels about 0, from smooth to noise, some of them over it."""
    shape = draw(st.tuples(*[st.integers(1, 7)] * 3))
    rng = np.random.default_rng(draw(seeds))
    noise = ndimage.gaussian_filter(rng.normal(size=shape), draw(st.sampled_from([0.0, 0.5, 1.0])))
    found = noise + draw(st.sampled_from([-0.3, 0.0, 0.3])) * noise.std()
    found[tuple(rng.integers(shape))] = 1.0
    return np.asarray(np.round(4 * found) if draw(st.booleans()) else found)


def radius_error(mesh: TriMesh) -> Floats:
    return np.asarray(np.abs(np.sqrt((mesh.corners.mean(axis=1) ** 2).sum(axis=1)) - 1))


class TestLaws:
    @law(60)
    @given(
        gray=levels(), affine=st.sampled_from([np.eye(4), LEFT_HANDED, SHEARED]), kind=st.sampled_from(["all", "outer"])
    )
    def test_the_mesh_is_sound_whatever_the_levels(self, gray: Floats, affine: Floats, kind: str) -> None:
        found, made = surface_of(volume_of(gray, affine), surface=kind)
        check_promise(made.mesh, cavities=found.cavities)
        assert not self_intersections(made.mesh).any()
        counted = topology(made.mesh, cavities=found.cavities)
        assert counted.euler_number == len(found.net.low) - len(found.net.quads)
        assert counted.components == len(found.volumes)
        assert kind == "all" or found.cavities == 0

    @law(60)
    @given(gray=levels())
    def test_there_is_a_surface_between_every_two_regions(self, gray: Floats) -> None:
        padded = np.pad(gray > 0, 1)
        joined = without_contacts(padded, lambda voxels: np.zeros(len(voxels)))
        found = boundary(volume_of(np.where(joined[1:-1, 1:-1, 1:-1], 1.0, -1.0)), joined[1:-1, 1:-1, 1:-1])
        inside, outside = (ndimage.label(mask)[1] for mask in (joined, ~joined))
        assert len(found.volumes) == inside + outside - 1
        assert found.cavities == outside - 1
        assert found.volumes.sum() == joined.sum()

    @law(60)
    @given(gray=levels())
    def test_vertices_stay_in_their_cells_and_crossings_between_their_voxels(self, gray: Floats) -> None:
        found, made = surface_of(volume_of(gray))
        within = made.net_fit.positions - found.net.low
        assert within.min() > 0
        assert within.max() < 1
        ways = (found.crossings.positions - found.net.inner) * found.net.steps
        assert ways.sum(axis=1).min() > 0
        assert ways.sum(axis=1).max() < 1
        assert (np.count_nonzero(ways, axis=1) == 1).all()

    @law(60)
    @given(solid=solids())
    def test_of_equal_levels_the_same_voxels_are_added_as_of_cubes(self, solid: NDArray[np.bool_]) -> None:
        joined = without_contacts(np.pad(solid.T, 1), lambda voxels: np.zeros(len(voxels)))[1:-1, 1:-1, 1:-1]
        np.testing.assert_array_equal(joined.T, composed(solid))

    @law(40)
    @given(gray=levels(), axis=st.integers(0, 2))
    def test_a_mirrored_study_gives_the_mirrored_surface(self, gray: Floats, axis: int) -> None:
        _, one = surface_of(volume_of(gray))
        _, other = surface_of(volume_of(np.flip(gray, 2 - axis)))
        mirrored = other.net_fit.positions.copy()
        mirrored[:, axis] = gray.shape[2 - axis] - 1 - mirrored[:, axis]
        order, turned = (np.lexsort(np.round(places, 9).T) for places in (one.net_fit.positions, mirrored))
        np.testing.assert_allclose(one.net_fit.positions[order], mirrored[turned], atol=1e-9)

    @law(20)
    @given(gray=levels())
    def test_threads_change_no_byte(self, gray: Floats) -> None:
        volume, mask = volume_of(gray), gray > 0
        with pytest.MonkeyPatch.context() as patch:
            patch.setattr(means, "BLOCK", 7)
            patch.setattr(settle, "BLOCK", 7)
            patch.setattr("tomomesh.isosurface.well_composed.LAYERS", 1)
            found = [boundary(volume, mask, lower=0.0, threads=n) for n in (1, 3)]
            made = [voxel_surface(one, FitSettings(), threads=n) for one, n in zip(found, (1, 3), strict=True)]
        assert made[0].mesh.vertices.tobytes() == made[1].mesh.vertices.tobytes()
        assert made[0].mesh.faces.tobytes() == made[1].mesh.faces.tobytes()


class TestParts:
    @law(20)
    @given(seed=seeds, cut=st.integers(1, 12))
    def test_squares_are_split_by_where_they_lie(self, seed: int, cut: int) -> None:
        """Not by their numbers: voxels that are left out below change nothing far above."""
        rng = np.random.default_rng(seed)
        gray = rng.normal(size=(24, 12, 12))
        part = gray.copy()
        part[:cut] = -1.0
        one, other = (halves_above(levels, cut + 8) for levels in (gray, part))
        assert one
        assert one == other

    @law(20)
    @given(seed=seeds, cut=st.integers(1, 12))
    def test_squares_take_turns_by_where_they_lie(self, seed: int, cut: int) -> None:
        gray = np.random.default_rng(seed).normal(size=(24, 5, 5))
        part = gray.copy()
        part[:cut] = -1.0
        one, other = (turns_of(levels) for levels in (gray, part))
        both = one.keys() & other.keys()
        assert {one[square] for square in both} == {False, True}
        assert all(one[square] == other[square] for square in both)


def turns_of(gray: Floats) -> dict[tuple[int, ...], bool]:
    """Return whose turn it is at each square, by the voxel behind it and the direction to the one before it."""
    net = boundary(volume_of(gray), gray > 0, lower=0.0).net
    squares = np.column_stack([net.inner, net.directions]).tolist()
    return dict(zip(map(tuple, squares), _is_odd(net).tolist(), strict=True))


def halves_above(gray: Floats, height: float) -> set[tuple[tuple[float, ...], ...]]:
    """Return the triangles over a height of a surface that is not fitted, by their places."""
    _, made = surface_of(volume_of(gray), settings=FitSettings(max_steps=0))
    corners = np.round(made.mesh.corners[(made.mesh.corners[:, :, 2] > height).all(axis=1)], 6)
    return {tuple(sorted(map(tuple, face))) for face in corners.tolist()}


class TestPlace:
    @pytest.mark.parametrize("kind", ["gray", "mask"])
    def test_a_finer_ball_is_nearer_to_the_truth(self, kind: str) -> None:
        """Second order where levels tell the place, between first and second where a mask does not."""
        errors = [radius_error(surface_of(ball(n, kind=kind))[1].mesh).mean() for n in (6, 12, 24)]
        order = np.log2(np.array(errors[:-1]) / errors[1:])
        assert order.min() > (1.8 if kind == "gray" else 0.8)

    @pytest.mark.parametrize("offset", [0.02, 0.25, 0.5, 0.731, 0.98])
    @pytest.mark.parametrize("axis", [0, 1, 2])
    def test_a_plane_along_the_voxels_is_exact(self, offset: float, axis: int) -> None:
        heights = np.broadcast_to(np.arange(8.0)[:, None, None], (8, 33, 33))
        _, made = surface_of(volume_of(np.moveaxis(3 + offset - heights, 0, 2 - axis)))
        across, *along = np.moveaxis(made.net_fit.positions, 1, 0)[[axis, (axis + 1) % 3, (axis + 2) % 3]]
        deep = (np.abs(np.array(along) - 16) < 3).all(axis=0) & (across > 1)
        assert deep.sum() == 36
        np.testing.assert_allclose(across[deep], 3 + offset, rtol=0, atol=1e-12)

    def test_a_slanted_plane_stays_a_plane(self) -> None:
        """But where it would push a vertex out of its cell, or passes the center of a voxel."""
        z, y, x = np.mgrid[:36, :36, :36]
        normal = np.array([0.37, 0.55, 0.75])
        _, made = surface_of(volume_of(28.9 - (normal[0] * x + normal[1] * y + normal[2] * z)))
        deep = (np.abs(made.net_fit.positions - 17.5) < 5).all(axis=1)
        apart = np.abs(made.net_fit.positions[deep] @ normal - 28.9)
        assert apart.max() < 3 * CLOSEST
        assert apart.mean() < 0.2 * CLOSEST

    def test_both_bounds_of_a_window_are_interpolated(self) -> None:
        volume = ball(14)
        _, made = surface_of(volume, 0.2, 0.6)
        outer, lining = (TriMesh(made.mesh.vertices, made.mesh.faces[part]) for part in _by_radius(made.mesh, 0.6))
        for mesh, radius in ((outer, 0.8), (lining, 0.4)):
            assert np.abs(np.sqrt((mesh.corners.mean(axis=1) ** 2).sum(axis=1)) - radius).mean() < 0.004

    @pytest.mark.parametrize("stiffness", [0.05, 0.25, 1.0])
    def test_the_net_rests_where_its_forces_balance(self, stiffness: float) -> None:
        """mean(p - c) + s mean(x_j - x) = 0, but where it presses a vertex against a face of its cell."""
        found, _ = surface_of(ball(6))
        rest = voxel_surface(found, FitSettings(tolerance=1e-10, stiffness=stiffness, max_steps=5000)).net_fit
        net, x = found.net, rest.positions
        pull = _mean(found.crossings.positions - _mean(x, net.quads), net.fans)
        force = pull + TENSION * stiffness * (_mean(x, net.links) - x)
        free = np.abs(x - net.low - 0.5) < 0.5 - MARGIN - 1e-12
        assert rest.trace.converged
        assert free.mean() > 0.8
        assert np.abs(force[free]).max() < 1e-8
        assert (force[~free] * np.sign(x - net.low - 0.5)[~free] > -1e-8).all()

    def test_a_mask_is_evened_out_and_yet_near(self) -> None:
        found, made = surface_of(ball(12, kind="mask"))
        rough = cubes_marched(ball(12, kind="mask"), 0.0)
        assert found.crossings.stepped
        assert mean_turn(made.mesh) < 0.4 * mean_turn(rough)
        assert radius_error(made.mesh).mean() < radius_error(rough).mean()

    def test_the_numbers_of_labels_do_not_matter(self) -> None:
        mask = ball(8, kind="mask").voxels > 0
        one, other = (surface_of(volume_of(np.where(mask, label, 0)), 0.5)[1].mesh for label in (1, 514))
        np.testing.assert_array_equal(one.vertices, other.vertices)

    @pytest.mark.parametrize(("blur", "noise", "stepped"), [(0.0, 0.05, True), (0.5, 0.05, False), (0.0, 3.0, False)])
    def test_a_noisy_mask_is_one_but_no_blurred_border(self, blur: float, noise: float, stepped: bool) -> None:
        mask = ball(10, kind="mask")
        blurred = ndimage.gaussian_filter(mask.voxels, blur) if blur else mask.voxels
        rough = blurred + noise * np.random.default_rng(0).normal(size=blurred.shape)
        assert surface_of(replace(mask, voxels=rough))[0].crossings.stepped == stepped

    @pytest.mark.parametrize("divide", [False, True])
    @pytest.mark.parametrize("shape", ["slab", "sheet", "rod", "block"])
    def test_a_mask_is_one_whatever_its_shape(self, shape: str, divide: bool) -> None:
        """Its borders with the slab's end, or a wall one voxel thick, leave no four voxels in a line."""
        mask = np.zeros((6, 24, 24), np.uint8)
        places: dict[str, Any] = {"slab": np.s_[:, 4:20, 4:20], "sheet": np.s_[3, 2:22, 2:22], "rod": np.s_[2, 3, 2:22]}
        mask[places.get(shape, np.s_[:, :, 6:9])] = 1
        found = boundary(volume_of(mask, np.diag([1.0, 1, 2, 1])), mask > 0, lower=0.5, divide=divide)
        assert found.crossings.stepped

    def test_gray_levels_are_no_mask_though_most_of_the_border_is_the_volumes(self) -> None:
        _, j, i = np.indices((4, 40, 40))
        levels = 100 / (1 + np.exp(np.hypot(i - 20, j - 20) - 14))
        found = boundary(volume_of(levels), levels > 50, lower=50.0)
        beyond = found.crossings.kinds == BORDER
        assert np.count_nonzero(beyond) > np.count_nonzero(~beyond)
        assert not found.crossings.stepped

    @pytest.mark.parametrize("spacing", [(1.0, 1.0, 1.0), (1.0, 1.0, 4.0)])
    def test_marching_cubes_finds_the_same_surface(self, spacing: tuple[float, float, float]) -> None:
        volume = ball(16, spacing)
        rng = np.random.default_rng(3)
        noise = ndimage.gaussian_filter(rng.normal(size=volume.shape), 1.0)
        noisy = replace(volume, voxels=volume.voxels + 0.2 * noise)
        _, made = surface_of(noisy)
        other = cubes_marched(noisy, 0.0)
        apart = compare(made.mesh, other)
        assert max(apart["mean_mm"], apart["back_mean_mm"]) < 0.1 * min(volume.spacing_mm)
        assert mean_turn(made.mesh) < mean_turn(other)

    @pytest.mark.parametrize("name", AFFINES)
    def test_the_mesh_is_carried_by_the_affine(self, name: str) -> None:
        gray = ball(5).voxels
        _, plain = surface_of(volume_of(gray))
        _, turned = surface_of(volume_of(gray, AFFINES[name]))
        expected = plain.mesh.vertices @ AFFINES[name][:3, :3].T + AFFINES[name][:3, 3]
        np.testing.assert_allclose(turned.mesh.vertices, expected, atol=1e-9)
        assert turned.mesh.face_volumes.sum() > 0


def _by_radius(mesh: TriMesh, radius: float) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
    far = (mesh.corners.mean(axis=1) ** 2).sum(axis=1) > radius**2
    return far, ~far


def _mean(values: Floats, lists: NDArray[np.int32]) -> Floats:
    """Average rows over lists of them, in which -1 stands for none."""
    kept = (lists >= 0)[:, :, None]
    return np.asarray(np.where(kept, values[lists], 0.0).sum(axis=1) / kept.sum(axis=1))
