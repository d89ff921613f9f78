"""The whole way, with numbers: the built-in head in, a closed surface out."""

from __future__ import annotations

import re
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
import trimesh

import tomomesh
from studies import shared
from tomomesh import reconstruct, reconstruct_points, segment
from tomomesh.errors import EmptyError, GeometryError
from tomomesh.measure.report import area_samples
from tomomesh.model.points import BRIDGE, CAP, NEURON
from tomomesh.model.volume import Volume
from tomomesh.settings import Settings

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from tomomesh.head_phantom import Phantom
    from tomomesh.results import Surface


@pytest.fixture(scope="module")
def head() -> Phantom:
    return tomomesh.phantom()


@pytest.fixture(scope="module")
def surface(head: Phantom) -> Surface:
    return reconstruct(head.volume, truth=head.truth, lower=head.lower, upper=head.upper)


def judged(surface: Surface) -> trimesh.Trimesh:
    """Weld at 32 bits, as an STL reader does, and let trimesh judge."""
    return trimesh.Trimesh(surface.mesh.vertices.astype(np.float32), surface.mesh.faces, process=True)


def widest_of_nearest(surface: Surface) -> float:
    """Return the widest distance of a neuron to the one nearest to it, row by row."""
    places = surface.points.positions[surface.points.kinds == NEURON]
    apart = [np.partition(np.linalg.norm(places - place, axis=1), 1)[1] for place in places]
    return float(max(apart))


def ball(shape: tuple[int, int, int] = (40, 48, 44), radius: float = 15.0) -> NDArray[np.int16]:
    axes = np.meshgrid(*(np.arange(n) - (n - 1) / 2 for n in shape), indexing="ij")
    return np.where(sum(a**2 for a in axes) < radius**2, np.int16(100), np.int16(0))


def stacked(voxels: NDArray[Any], spacing: tuple[float, float, float] = (1.0, 1.0, 1.0)) -> Volume:
    return Volume.from_stored(voxels, np.diag([*spacing, 1.0]))


class TestDemo:
    def test_surface_is_closed_and_near_the_truth(self, surface: Surface) -> None:
        mesh = judged(surface)
        assert mesh.is_watertight
        assert mesh.is_winding_consistent
        assert mesh.body_count == 1
        assert mesh.euler_number == 2
        assert mesh.volume > 0
        truth = surface.report["truth"]
        assert max(truth["mean_mm"], truth["back_mean_mm"]) <= 0.15
        assert max(truth["p95_mm"], truth["back_p95_mm"]) <= 0.35
        assert 0.9 < surface.report["quality"]["volume_over_rings"] < 1.1

    def test_another_judge_measures_the_same_error(self, surface: Surface, head: Phantom) -> None:
        truth = area_samples(head.truth, 400)
        mesh = judged(surface)
        distance = np.abs(trimesh.proximity.closest_point_naive(mesh, truth)[1])
        assert distance.mean() == pytest.approx(surface.report["truth"]["back_mean_mm"], rel=0.25)

    def test_fit_comes_to_rest_within_thirty_steps(self, surface: Surface) -> None:
        assert surface.trace is not None
        assert surface.trace.converged
        assert len(surface.trace.speed) <= 30

    def test_the_neurons_themselves_draw_the_mesh_half_as_near(self, surface: Surface, head: Phantom) -> None:
        nearest = reconstruct(head.volume, truth=head.truth, lower=head.lower, upper=head.upper, attraction="nearest")
        assert nearest.report["way"]["name"] == "networks"
        assert surface.report["truth"]["p50_mm"] <= 0.4 * nearest.report["truth"]["p50_mm"]

    def test_the_papers_choices_close_too(self, head: Phantom) -> None:
        """Measured: 0.422 and 0.730 mm there, 0.417 mm back, 0.999 of the volume, 4,492 vertices, 20 steps; + 10 %."""
        paper = reconstruct(head.volume, Settings.for_paper(), truth=head.truth, lower=head.lower, upper=head.upper)
        mesh, truth, points = judged(paper), paper.report["truth"], paper.report["points"]
        assert mesh.is_watertight
        assert mesh.euler_number == 2
        assert truth["mean_mm"] < 0.465
        assert truth["p95_mm"] < 0.80
        assert truth["back_mean_mm"] < 0.46
        assert 0.98 < paper.report["quality"]["volume_over_rings"] < 1.02
        assert len(paper.mesh.vertices) > points["measured"]
        assert paper.trace is not None
        assert paper.trace.converged
        assert 20 <= len(paper.trace.speed) <= 30, "the paper's own range"
        assert points["spacing_mm"] == pytest.approx(widest_of_nearest(paper), rel=1e-12)
        assert paper.report["cubes"]["cell_mm"] == [points["spacing_mm"]] * 3

    def test_the_other_reading_of_the_papers_r_costs_four_times_the_error(self, head: Phantom) -> None:
        """Measured: 1.856 mm with cubes of 22.5 mm, the longest edge of a network; 10 % either way."""
        wide = reconstruct(
            head.volume, Settings.for_paper(), truth=head.truth, lower=head.lower, upper=head.upper,
            cell_from="adjacent", allow_far=True,
        )  # fmt: skip
        assert judged(wide).euler_number == 2
        assert 1.67 < wide.report["truth"]["mean_mm"] < 2.05
        assert len(wide.mesh.vertices) < 400

    @pytest.mark.parametrize("changes", [{"caps": False}, {"closing": 0}, {"caps": False, "closing": 0}])
    def test_the_paper_to_the_letter_leaks_and_is_refused(self, head: Phantom, changes: dict[str, Any]) -> None:
        """Without caps or closing the shell has holes, as the paper's Fig. 10 has where neurons are far apart."""
        with pytest.raises(GeometryError, match="leaks") as refused:
            reconstruct(head.volume, Settings.for_paper(), lower=head.lower, upper=head.upper, **changes)
        assert refused.value.exit_code == 5

    def test_the_papers_tracker_gives_the_bytes_of_the_scan(self, head: Phantom) -> None:
        made = [
            reconstruct(head.volume, Settings.for_paper(), lower=head.lower, upper=head.upper, tracking=way).mesh
            for way in ("faces", "scan")
        ]
        assert made[0].vertices.tobytes() == made[1].vertices.tobytes()
        assert made[0].faces.tobytes() == made[1].faces.tobytes()

    def test_same_bytes_on_any_number_of_threads(self, surface: Surface, head: Phantom) -> None:
        single = reconstruct(head.volume, lower=head.lower, upper=head.upper, threads=1)
        assert single.mesh.vertices.tobytes() == surface.mesh.vertices.tobytes()
        assert single.mesh.faces.tobytes() == surface.mesh.faces.tobytes()
        assert single.points.positions.tobytes() == surface.points.positions.tobytes()

    def test_a_stack_without_its_caps_is_refused(self, head: Phantom) -> None:
        with pytest.raises(GeometryError, match="two walls"):
            reconstruct(head.volume, lower=head.lower, upper=head.upper, caps=False)

    @pytest.mark.parametrize("cell", [2.0, 12.0])
    def test_other_cubes_rest_on_the_same_surface(self, head: Phantom, cell: float) -> None:
        """Measured: .086 and .104 mm there, .072 and .111 mm back."""
        made = reconstruct(head.volume, truth=head.truth, lower=head.lower, upper=head.upper, cell_mm=cell)
        assert max(made.report["truth"]["mean_mm"], made.report["truth"]["back_mean_mm"]) < 0.13

    def test_points_are_told_apart(self, surface: Surface) -> None:
        kinds = surface.points.kinds
        assert (kinds == NEURON).sum() == 54 * surface.report["networks"]["neurons"]
        assert (kinds == BRIDGE).any()
        assert (kinds == CAP).any()
        assert np.isfinite(surface.points.positions).all()
        assert (surface.points.neurons[kinds != NEURON] == -1).all()

    def test_labels_name_the_nearest_neuron(self, surface: Surface) -> None:
        stage_one = surface.segmentation
        assert stage_one is not None
        k = 30
        pixel = np.array(stage_one.volume.spacing_mm[:2])
        places = np.argwhere(stage_one.mask[k])[:, ::-1] * pixel
        neurons = stage_one.source.codebooks[k] * pixel
        nearest = ((places[:, None] - neurons) ** 2).sum(axis=2).argmin(axis=1)
        assert (stage_one.labels[k][stage_one.mask[k]] == nearest + 1).all()
        assert (stage_one.labels[~stage_one.mask] == 0).all()


class TestReport:
    def test_sections_stand_in_their_order(self, surface: Surface) -> None:
        assert tuple(surface.report) == (
            "way", "study", "window", "networks", "rings", "points", "cubes", "surface", "fit", "remesh", "quality",
            "truth", "timings", "settings", "versions", "warnings",
        )  # fmt: skip

    def test_every_key_is_documented_and_every_documented_key_is_there(self, surface: Surface) -> None:
        page = (Path(__file__).parents[1] / "docs" / "report.md").read_text(encoding="utf-8")
        described = set(re.findall(r"^\| `([a-z_]+\.[a-z0-9_]+)` \|", page, re.MULTILINE))
        sections = {name: found for name, found in surface.report.items() if name not in ("settings", "warnings")}
        present = {f"{name}.{key}" for name, found in sections.items() for key in found}
        assert {key for key in described if key.split(".")[0] in sections} == present

    def test_it_repeats_but_for_the_times(self, surface: Surface, head: Phantom) -> None:
        again = reconstruct(head.volume, truth=head.truth, lower=head.lower, upper=head.upper)
        first, second = dict(surface.report), dict(again.report)
        assert first.pop("timings").keys() == second.pop("timings").keys()
        assert first == second


class TestStudies:
    def test_a_ball_keeps_its_volume(self) -> None:
        found = reconstruct(stacked(ball()))
        assert found.report["networks"]["signal"] == "boundary"
        assert found.report["quality"]["sound"]
        assert found.report["quality"]["genus"] == 0
        assert found.report["quality"]["volume_mm3"] == pytest.approx(4 / 3 * np.pi * 15**3, rel=0.12)

    def test_any_axis_order_gives_the_same_mesh(self) -> None:
        voxels = ball((30, 40, 36), 13.0)
        voxels[:, :20, :18] //= 2
        reference = reconstruct(stacked(voxels))
        turned = np.flip(voxels, (0, 2)).transpose(2, 0, 1)
        affine = np.zeros((4, 4))
        affine[1, 0] = 1.0
        affine[2, 1] = -1.0
        affine[0, 2] = -1.0
        affine[:, 3] = [35, 0, 29, 1]
        found = reconstruct(Volume.from_stored(turned, affine))
        assert found.mesh.faces.tobytes() == reference.mesh.faces.tobytes()
        np.testing.assert_allclose(found.mesh.vertices, reference.mesh.vertices, atol=1e-9)

    def test_a_window_that_keeps_everything_gives_a_closed_box(self) -> None:
        found = reconstruct(stacked(np.ones((12, 40, 30), np.uint8)), lower=0)
        assert judged(found).is_watertight
        assert found.report["window"]["touches_border"]
        assert found.report["warnings"]
        assert found.report["quality"]["volume_mm3"] == pytest.approx(11 * 39 * 29, rel=0.2)

    def test_a_window_that_keeps_nothing_names_the_range(self) -> None:
        with pytest.raises(EmptyError, match="between 0 and 100"):
            reconstruct(stacked(ball()), lower=500)

    def test_a_slice_without_pixels_has_no_network(self) -> None:
        voxels = ball()
        voxels[20] = 0
        found = reconstruct(stacked(voxels), way="ring")
        assert 20 in found.report["networks"]["slices_without"]
        assert "20" in found.report["warnings"][0]
        assert judged(found).is_watertight
        assert found.report["quality"]["components"] == 1

    def test_slices_with_fewer_pixels_than_neurons_are_left_out(self) -> None:
        with pytest.raises(EmptyError, match="fewer --neurons"):
            segment(stacked(ball(radius=3.0)), way="ring", neurons=500)

    def test_gantry_tilt_keeps_the_volume(self) -> None:
        affine = np.eye(4)
        affine[1, 2] = np.tan(np.radians(25))
        found = reconstruct(Volume.from_stored(ball(), affine))
        straight = reconstruct(stacked(ball()))
        ratios = [one.report["quality"]["volume_over_rings"] for one in (found, straight)]
        assert ratios[0] == pytest.approx(ratios[1], abs=0.03)

    def test_kept_zero_stays_kept(self) -> None:
        found = segment(stacked(100 - ball()), lower=-1, upper=50)
        assert found.mask.sum() == (ball() > 0).sum()

    def test_oblong_pixels_keep_a_ball_round(self) -> None:
        axes = np.meshgrid(np.arange(21) * 2.0 - 20, np.arange(81) * 0.7 - 28, np.arange(101) * 0.5 - 25, indexing="ij")
        voxels = (100 * (sum(a**2 for a in axes) < 18**2)).astype(np.uint8)
        found = reconstruct(stacked(voxels, (0.5, 0.7, 2.0)))
        extent = np.ptp(found.mesh.vertices, axis=0)
        np.testing.assert_allclose(extent[:2], 36, atol=2)

    def test_progress_is_told_and_can_stop_the_work(self) -> None:
        told: list[str] = []

        def stop(stage: str, done: int, total: int) -> None:
            told.append(stage)
            assert 0 <= done <= total
            if stage == "fit":
                raise KeyboardInterrupt

        with pytest.raises(KeyboardInterrupt):
            reconstruct(stacked(ball()), progress=stop)
        assert {"networks", "closing", "fit"} <= set(told)


class TestClouds:
    @pytest.mark.parametrize("points", [np.zeros((1, 3)), np.zeros((50, 3)), np.eye(3)[:2], np.eye(3), "line", "plane"])
    def test_flat_clouds_give_their_closed_shell_and_a_warning(self, points: Any) -> None:
        spread = np.random.default_rng(0).random((500, 3))
        flat = {"line": spread * [1, 0, 0] + 5, "plane": spread @ np.array([[1, 0, 1], [0, 1, 1], [0, 0, 0]])}
        found = reconstruct_points(flat[points] if isinstance(points, str) else points)
        assert judged(found).is_watertight
        assert "not fitted" in found.report["warnings"][0]

    def test_repeated_points_change_nothing(self) -> None:
        points = np.random.default_rng(0).normal(size=(800, 3))
        points /= np.linalg.norm(points, axis=1, keepdims=True)
        once, often = reconstruct_points(points), reconstruct_points(np.tile(points, (3, 1))[::-1])
        assert once.mesh.vertices.tobytes() == often.mesh.vertices.tobytes()

    @pytest.mark.parametrize("noise", [0.0, 1.5])
    @pytest.mark.parametrize("count", [2000, 8000])
    def test_open_clouds_are_refused(self, count: int, noise: float) -> None:
        rng = np.random.default_rng(count)
        ball = rng.normal(size=(2 * count, 3))
        ball *= 50 / np.linalg.norm(ball, axis=1, keepdims=True)
        angle, height = rng.random((2, count))
        tube = np.column_stack([20 * np.cos(7 * angle), 20 * np.sin(7 * angle), 100 * height])
        for cloud in (ball[ball[:, 2] > 0], tube):
            with pytest.raises(GeometryError, match="two walls"):
                reconstruct_points(cloud + rng.normal(size=cloud.shape) * noise)

    def test_no_points_are_empty(self) -> None:
        with pytest.raises(EmptyError):
            reconstruct_points(np.zeros((0, 3)))

    def test_a_sheet_is_refused_and_allowed(self) -> None:
        rng = np.random.default_rng(0)
        sheet = np.column_stack([rng.random((2000, 2)), 0.005 * rng.random(2000)])
        with pytest.raises(GeometryError, match="two walls"):
            reconstruct_points(sheet)
        assert judged(reconstruct_points(sheet, allow_leaks=True)).is_watertight

    def test_contours_of_two_bodies_close(self) -> None:
        points = tomomesh.read_points(shared("clouds/contours/torus_sphere_5to1.xyz"))
        quality = reconstruct_points(points).report["quality"]
        assert quality["components"] == 2
        assert quality["genus"] == 1
        assert quality["volume_mm3"] == pytest.approx(243_103, rel=0.05)
