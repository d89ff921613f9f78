"""The window's own boundary as a surface: closed, in its cells, where the gray levels say, without a staircase."""

from __future__ import annotations

import json
import re
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import nibabel
import numpy as np
import pytest
import trimesh
from hypothesis import given
from hypothesis import strategies as st
from scipy import ndimage
from skimage.measure import marching_cubes

from conftest import composed, law, seeds, size, solids
from studies import AFFINES, shared, write_nifti
from tomomesh.cli import main
from tomomesh.errors import EmptyError, ResourceError
from tomomesh.io import read_mesh, read_points, read_volume
from tomomesh.isosurface import surface_nets as nets
from tomomesh.isosurface.crossings import CLOSEST
from tomomesh.isosurface.diagonals import _is_odd
from tomomesh.isosurface.surface_nets import MARGIN, TENSION
from tomomesh.isosurface.voxels import Boundary, VoxelSurface, boundary, voxel_surface
from tomomesh.isosurface.well_composed import without_contacts
from tomomesh.measure.intersections import self_intersections
from tomomesh.measure.report import compare
from tomomesh.measure.topology import check_promise, topology
from tomomesh.model.mesh import TriMesh
from tomomesh.model.points import BORDER, CROSSING
from tomomesh.model.volume import Grid, Volume
from tomomesh.pipeline import reconstruct, segment
from tomomesh.segmentation.window import window
from tomomesh.settings import FitSettings

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from tomomesh.results import Surface

    Floats = NDArray[np.float64]

LEFT_HANDED = np.array([[0.7, 0.1, 0.0, 3.0], [0.0, -0.9, 0.2, -5.0], [0.1, 0.0, 2.0, 8.0], [0.0, 0.0, 0.0, 1.0]])
SHEARED = np.array([[0.6, 0.0, 0.0, 0.0], [0.0, 0.6, 0.9, 0.0], [0.0, 0.0, 2.0, 0.0], [0.0, 0.0, 0.0, 1.0]])


def volume_of(levels: NDArray[Any], affine: Floats | None = None) -> Volume:
    """Take levels as they are, whatever the handedness of the affine."""
    affine = np.eye(4) if affine is None else affine
    return Volume(levels, affine, Grid((0, 1, 2), (False, False, False), affine))


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


def ball(steps: int, spacing: tuple[float, float, float] = (1.0, 1.0, 1.0), *, kind: str = "gray") -> Volume:
    """Sample a ball of radius 1 about the origin, so many steps of the finest spacing to its radius."""
    edges = np.array(spacing) / steps
    sides = [np.arange(-np.ceil(1.3 / e), np.ceil(1.3 / e) + 1) * e for e in edges]
    z, y, x = np.meshgrid(*(sides[n] + 0.31 * edges[n] for n in (2, 1, 0)), indexing="ij")
    affine = np.diag([*edges, 1.0])
    affine[:3, 3] = [sides[n][0] + 0.31 * edges[n] for n in range(3)]
    height = 1 - np.sqrt(x**2 + y**2 + z**2)
    return volume_of(height if kind == "gray" else np.where(height > 0, 1.0, -1.0), affine)


def radius_error(mesh: TriMesh) -> Floats:
    return np.asarray(np.abs(np.sqrt((mesh.corners.mean(axis=1) ** 2).sum(axis=1)) - 1))


def mean_turn(mesh: TriMesh) -> float:
    """Return the mean angle between the normals of neighboring faces, in degrees."""
    _, edge = np.unique(np.sort(mesh.half_edges, axis=1), axis=0, return_inverse=True)
    first, second = (np.argsort(edge.ravel(), kind="stable") // 3).reshape(-1, 2).T
    normals = mesh.face_vectors / np.maximum(2 * mesh.face_areas, 1e-300)[:, None]
    cosine = (normals[first] * normals[second]).sum(axis=1)
    return float(np.degrees(np.arccos(np.clip(cosine, -1, 1))).mean())


def cubes_marched(volume: Volume, lower: float) -> TriMesh:
    """Return scikit-image's surface of the padded levels, which on the border lies half way to the padding."""
    padded = np.pad(volume.voxels.astype(np.float64), 1, mode="edge")
    inner = np.zeros(padded.shape, bool)
    inner[1:-1, 1:-1, 1:-1] = True
    padded = np.where(inner | (padded <= lower), padded, 2 * lower - padded)
    places, faces, _, _ = marching_cubes(padded.astype(np.float32), lower)
    return TriMesh(volume.to_mm(places[:, ::-1].astype(np.float64) - 1), faces.astype(np.int64))


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
            patch.setattr(nets, "BLOCK", 7)
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


class TestSpecial:
    def test_one_voxel_is_a_closed_box(self) -> None:
        gray = np.full((3, 3, 3), -1.0)
        gray[1, 1, 1] = 1.0
        for levels in (gray, np.ones((1, 1, 1))):
            _, made = surface_of(volume_of(levels))
            assert (len(made.mesh.vertices), len(made.mesh.faces)) == (8, 12)
            assert topology(made.mesh).sound
            assert 0 < made.mesh.face_volumes.sum() <= 1
            assert np.abs(made.mesh.vertices - np.array(levels.shape) // 2).max() <= 0.5

    @pytest.mark.parametrize("noise", [0.0, 0.1])
    def test_a_checkerboard_is_closed_and_manifold(self, noise: float) -> None:
        z, y, x = np.mgrid[:12, :12, :12]
        gray = np.where((x + y + z) % 2, 1.0, -1.0) + noise * np.random.default_rng(0).normal(size=x.shape)
        found, made = surface_of(volume_of(gray))
        check_promise(made.mesh, cavities=found.cavities)
        assert not self_intersections(made.mesh).any()
        assert found.added > 0

    def test_what_touches_the_border_is_capped_half_a_voxel_further(self) -> None:
        found, made = surface_of(volume_of(np.ones((4, 5, 6))))
        assert (found.points.kinds == BORDER).all()
        np.testing.assert_allclose(found.crossings.positions.min(axis=0), -0.5)
        np.testing.assert_allclose(found.crossings.positions.max(axis=0), [5.5, 4.5, 3.5])
        assert topology(made.mesh).euler_number == 2

    def test_what_is_no_number_is_background(self) -> None:
        gray = ball(6).voxels.copy()
        gray[gray > 0.5], gray[0] = np.nan, -np.inf
        found, made = surface_of(volume_of(gray))
        check_promise(made.mesh, cavities=found.cavities)
        assert found.cavities == 1
        assert np.isfinite(found.crossings.positions).all()

    def test_of_colors_the_first_to_leave_the_window_counts(self) -> None:
        gray = ball(8).voxels
        _, plain = surface_of(volume_of(gray))
        _, colored = surface_of(volume_of(np.stack([gray, gray + 0.2, np.full(gray.shape, 1.0)], axis=3)))
        np.testing.assert_allclose(plain.mesh.vertices, colored.mesh.vertices, atol=1e-12)

    def test_the_surface_of_masks_is_as_surface_nets_have_it(self) -> None:
        """A vertex in every mixed cell, and a square for every face: VTK counts the same."""
        core, data = (pytest.importorskip(f"vtkmodules.{name}") for name in ("vtkFiltersCore", "vtkCommonDataModel"))
        from vtkmodules.util.numpy_support import numpy_to_vtk

        gray = ndimage.gaussian_filter(np.random.default_rng(1).normal(size=(14, 15, 16)), 1.5)
        joined = without_contacts(np.pad(gray > 0, 1), lambda voxels: np.zeros(len(voxels)))
        found = boundary(volume_of(joined.astype(np.uint8)), joined, lower=0.5)
        image = data.vtkImageData()
        image.SetDimensions(*joined.shape[::-1])
        image.GetPointData().SetScalars(numpy_to_vtk(joined.ravel().astype(np.uint8), deep=True))
        peer = core.vtkSurfaceNets3D()
        peer.SetInputData(image)
        peer.SetValue(0, 1)
        peer.SmoothingOff()
        peer.SetOutputMeshTypeToQuads()
        peer.Update()
        assert peer.GetOutput().GetNumberOfPoints() == len(found.net.low)
        assert peer.GetOutput().GetNumberOfCells() == len(found.net.quads)

    def test_what_would_not_fit_is_refused(self, monkeypatch: pytest.MonkeyPatch) -> None:
        monkeypatch.setattr("tomomesh.isosurface.well_composed.MOST_CELLS", 100)
        with pytest.raises(ResourceError, match="too large") as refused:
            reconstruct(ball(6), lower=0.0, network="none")
        assert refused.value.exit_code == 7

    def test_an_empty_window_is_refused(self) -> None:
        with pytest.raises(EmptyError):
            reconstruct(ball(6), lower=5.0, network="none")


class TestWay:
    """From a study to a surface, through `reconstruct` and the command line."""

    def test_a_study_gives_points_and_a_surface(self) -> None:
        surface = reconstruct(ball(8), lower=0.0, network="none")
        report, stage_one = surface.report, surface.segmentation
        assert stage_one is not None
        assert report["voxels"] == {
            "added_for_composition": 0, "interpolated": True, "divided_into": 1, "split_in_four": 0,
        }  # fmt: skip
        assert report["surface"]["square_faces"] == report["points"]["measured"] == len(surface.points)
        assert report["surface"]["enclosed_cubes"] == np.count_nonzero(stage_one.mask) == (stage_one.labels == 1).sum()
        assert report["fit"]["converged"]
        assert report["quality"]["points_to_surface_mean_mm"] < 0.1 / 8
        assert surface.cuberille.triangulated().face_volumes.sum() == pytest.approx(stage_one.mask.sum() / 8**3)
        assert not surface.cap_faces.any()

    def test_every_key_of_its_report_is_documented(self) -> None:
        page = (Path(__file__).parents[1] / "docs" / "report.md").read_text(encoding="utf-8")
        described = set(re.findall(r"^\| `([a-z_]+\.[a-z0-9_]+)` \|", page, re.MULTILINE))
        report = reconstruct(ball(6), lower=0.0, network="none").report
        sections = {name: found for name, found in report.items() if name not in ("settings", "warnings")}
        assert {f"{name}.{key}" for name, found in sections.items() for key in found} <= described

    def test_the_plane_of_the_slices_does_not_move_the_surface(self) -> None:
        made = [
            reconstruct(ball(6), lower=0.0, network="none", slices=plane, remesh=False)
            for plane in ("axial", "sagittal")
        ]
        one, other = (np.round(surface.mesh.vertices, 9) + 0.0 for surface in made)
        np.testing.assert_array_equal(one[np.lexsort(one.T)], other[np.lexsort(other.T)])
        assert all(topology(surface.mesh).sound for surface in made)

    def test_cavities_are_kept_unless_the_outer_surfaces_are_asked_for(self) -> None:
        both = reconstruct(ball(8), lower=0.0, upper=0.5, network="none")
        outer = reconstruct(ball(8), lower=0.0, upper=0.5, network="none", surface="outer")
        assert (both.report["surface"]["found"], both.report["surface"]["cavities"]) == (2, 1)
        assert (outer.report["surface"]["found"], outer.report["surface"]["cavities"]) == (1, 0)
        assert both.mesh.face_volumes.sum() < outer.mesh.face_volumes.sum()

    def test_stage_one_alone_gives_the_crossings(self) -> None:
        found = segment(ball(8), lower=0.0, network="none")
        assert (found.points.kinds == CROSSING).all()
        assert np.abs(np.sqrt((found.points.positions**2).sum(axis=1)) - 1).max() < 0.01

    @pytest.mark.parametrize(("divide", "near"), [(False, 0.1 * 1.25), (True, 0.05 * 4)])
    def test_of_a_ct_bone_is_where_marching_cubes_have_it(self, divide: bool, near: float) -> None:
        """Between thick slices marching cubes are no truth: what was made into slabs lies nearer divided (docs)."""
        study = read_volume(shared("dicom2stl/ct_example.nii.gz"))
        surface = reconstruct(study, preset="bone", way="voxels", divide=divide)
        other = cubes_marched(study, 300.0)
        apart = compare(surface.mesh, other)
        assert max(apart["mean_mm"], apart["back_mean_mm"]) < near
        assert mean_turn(surface.mesh) < mean_turn(other)
        assert surface.report["quality"]["sound_after_welding"]

    def test_the_command_line_writes_all_of_it(self, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
        volume = ball(size(9, 6), (1.0, 1.0, 2.0))
        stored = np.round(1000 * volume.voxels).astype(np.int16)
        study = write_nifti(tmp_path / "ball.nii", stored, volume.affine)
        names = {"points": "points.ply", "labels": "labels.nii.gz", "report": "report.json", "figures": "pictures"}
        further = [word for name, file in names.items() for word in (f"--{name}", str(tmp_path / file))]
        mesh = tmp_path / "mesh.stl"
        words = ["reconstruct", str(study), "-o", str(mesh), "--lower", "0", "--network", "none", *further]
        assert main(words) == 0
        told = capsys.readouterr().out.splitlines()
        assert any(line.startswith("voxels ") for line in told)
        assert not any(line.startswith("networks ") for line in told)
        judged = trimesh.load(mesh)
        assert judged.is_watertight
        assert judged.is_winding_consistent
        assert judged.volume == pytest.approx(4 / 3 * np.pi, rel=0.02)
        report = json.loads((tmp_path / "report.json").read_text())
        assert len(read_points(tmp_path / "points.ply")) == report["points"]["count"]
        labels = np.asarray(nibabel.load(tmp_path / "labels.nii.gz").dataobj)
        np.testing.assert_array_equal(labels, (stored.T > 0).astype(np.uint16))
        assert {path.stem for path in (tmp_path / "pictures").iterdir()} >= {"04-window", "07-points", "10-shaded"}

    def test_so_does_stage_one(self, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
        volume = ball(6)
        study = write_nifti(tmp_path / "ball.nii", np.round(1000 * volume.voxels).astype(np.int16), volume.affine)
        target = tmp_path / "points.csv"
        assert main(["segment", str(study), "-o", str(target), "--lower", "0", "--network", "none"]) == 0
        assert len(read_points(target)) == len(boundary(volume, volume.voxels > 0.0005, lower=0.0).net.quads)
        assert "points " in capsys.readouterr().out


def test_a_mesh_survives_its_file(tmp_path: Path) -> None:
    from tomomesh import write_mesh

    made: Surface = reconstruct(ball(6), lower=0.0, network="none")
    write_mesh(made.mesh, tmp_path / "mesh.stl")
    assert topology(read_mesh(tmp_path / "mesh.stl")).sound
