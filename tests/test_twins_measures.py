"""What is measured of triangles and meshes, beside its slow twin."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pytest
import trimesh
from hypothesis import given

from conftest import law, seeds, size, sphere
from test_twins_geometry import icosphere, soups
from tomomesh.cli.summary import of_check
from tomomesh.measure.report import assess
from tomomesh.measure.shape import triangle_shapes
from tomomesh.measure.topology import welded
from tomomesh.model.mesh import TriMesh

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Floats = NDArray[np.float64]

pytestmark = pytest.mark.usefixtures("fewer_samples")


class TestShapes:
    @law(40)
    @given(mesh=soups())
    def test_are_trimesh_s(self, mesh: TriMesh) -> None:
        judge = trimesh.Trimesh(mesh.vertices, mesh.faces, process=False)
        found = triangle_shapes(mesh)
        lengths = np.linalg.norm(mesh.corners - np.roll(mesh.corners, 1, axis=1), axis=2)
        assert found["shortest_edge_mm"] == pytest.approx(lengths.min())
        assert found["p5_edge_mm"] == pytest.approx(np.percentile(lengths, 5))
        assert found["median_edge_mm"] == pytest.approx(np.median(lengths))
        assert found["p95_edge_mm"] == pytest.approx(np.percentile(lengths, 95))
        assert found["longest_edge_mm"] == pytest.approx(lengths.max())
        thick = judge.area_faces > 1e-9
        if thick.all():
            angles = np.degrees(judge.face_angles)
            assert found["smallest_angle_deg"] == pytest.approx(angles.min(), abs=1e-3)
            assert found["p5_smallest_angle_deg"] == pytest.approx(np.percentile(angles.min(axis=1), 5), abs=1e-3)
            assert found["mean_smallest_angle_deg"] == pytest.approx(angles.min(axis=1).mean(), abs=1e-3)
            assert found["largest_angle_deg"] == pytest.approx(angles.max(), abs=1e-3)
        assert 0 <= found["mean_aspect"] <= 1
        assert found["mean_turn_deg"] == found["largest_turn_deg"] == 0

    @law(20)
    @given(seed=seeds)
    def test_turns_are_trimesh_s(self, seed: int) -> None:
        mesh = icosphere()
        rough = mesh.moved(mesh.vertices * np.random.default_rng(seed).uniform(0.7, 1.3, (len(mesh.vertices), 1)))
        angles = np.degrees(trimesh.Trimesh(rough.vertices, rough.faces, process=False).face_adjacency_angles)
        found = triangle_shapes(rough)
        assert found["mean_turn_deg"] == pytest.approx(angles.mean())
        assert found["largest_turn_deg"] == pytest.approx(angles.max())
        flipped = np.where(np.arange(len(rough.faces))[:, None] == 3, rough.faces[:, ::-1], rough.faces)
        assert triangle_shapes(TriMesh(rough.vertices, flipped)) == pytest.approx(found)

    def test_of_an_equilateral_triangle_are_perfect(self) -> None:
        one = TriMesh(np.array([[1.0, 0, 0], [0, 1, 0], [0, 0, 1]]), np.array([[0, 1, 2]]))
        found = triangle_shapes(one)
        assert found["mean_aspect"] == pytest.approx(1)
        assert found["smallest_angle_deg"] == pytest.approx(60)
        assert found["largest_angle_deg"] == pytest.approx(60)


class TestAssess:
    def test_agrees_with_trimesh(self) -> None:
        mesh = icosphere(10.0, (100.0, -50.0, 7.0))
        found = assess(mesh, points=sphere(200) + np.array([100, -50, 7]), against=icosphere(11.0, (100.0, -50.0, 7.0)))
        judge = trimesh.Trimesh(mesh.vertices, mesh.faces)
        assert found["area_mm2"] == pytest.approx(judge.area)
        assert found["volume_mm3"] == pytest.approx(judge.volume)
        assert found["euler_number"] == judge.euler_number == 2
        assert found["closed"] == judge.is_watertight
        assert found["sound"]
        assert found["sound_after_welding"]
        assert found["self_intersections"] == 0
        assert found["points_to_surface_mean_mm"] < size(0.1, 1.0)
        assert found["vertices_to_points_max_mm"] < 3
        assert found["mean_mm"] == pytest.approx(1, abs=size(0.05, 0.5))

    def test_a_single_component_is_the_mesh(self) -> None:
        found = assess(icosphere(2.0), points=sphere(100, 2.2))
        (only,) = found["per_component"]
        assert found["components_not_listed"] == 0
        assert only.pop("points") == 100
        assert only.pop("area_mm2") == pytest.approx(found["area_mm2"])
        assert only.pop("volume_mm3") == pytest.approx(found["volume_mm3"])
        assert only == {key: found[key] for key in only}

    @law(12)
    @given(seed=seeds)
    def test_components_are_those_of_each_alone(self, seed: int) -> None:
        rng = np.random.default_rng(seed)
        torus = trimesh.creation.torus(4.0, 1.0, major_sections=12, minor_sections=8)
        ring = TriMesh(np.array(torus.vertices), np.array(torus.faces, np.int64))
        parts = [ring, icosphere(), TriMesh(icosphere().vertices * 2, icosphere().faces[1:])]
        parts = [part.moved(part.vertices + 12 * n) for n, part in enumerate(parts)]
        begin = np.cumsum([0] + [len(part.vertices) for part in parts])
        faces = np.concatenate([part.faces + n for part, n in zip(parts, begin[:-1], strict=True)])
        number = rng.permutation(begin[-1])
        vertices = np.empty((begin[-1], 3))
        vertices[number] = np.concatenate([part.vertices for part in parts])
        points = vertices + rng.normal(size=vertices.shape) * 0.1
        found = assess(TriMesh(vertices, number[rng.permutation(faces)]), points=points)
        alone = [assess(part, points=points[number[b:e]]) for part, b, e in zip(parts, begin, begin[1:], strict=False)]
        alone.sort(key=lambda one: -one["area_mm2"])
        for own, wanted in zip(found["per_component"], alone, strict=True):
            assert own.pop("points") == wanted["vertices"]
            assert own == {key: pytest.approx(wanted[key]) for key in own}
        assert found["volume_mm3"] is None
        assert (found["boundary_loops"], found["boundary_edges"]) == (1, 3)
        assert [own["genus"] for own in found["per_component"]] == [1, 0, 0]

    def test_is_told_in_fifteen_lines(self) -> None:
        ball = icosphere()
        parts = [ball.moved(ball.vertices * n + 9 * n) for n in (5, 4, 3, 2, 1)]
        faces = [part.faces + n * len(ball.vertices) for n, part in enumerate(parts)]
        faces[0] = faces[0][1:]
        mesh = TriMesh(np.concatenate([part.vertices for part in parts]), np.concatenate(faces))
        lines = of_check(assess(mesh, against=ball))
        assert len(lines) <= 15
        said = "\n".join(lines)
        for told in ("3 boundary edges", "1 border(s)", "no face(s) pass", "part 1", "part 3", "and 2 more", "open"):
            assert told in said
        assert len(of_check(assess(ball))) == 7

    def test_lists_a_hundred_components_and_counts_the_rest(self) -> None:
        tetrahedron = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]])
        scale = np.linspace(1, 2, 130)[:, None, None]
        vertices = (tetrahedron * scale + np.arange(130)[:, None, None] * 5).reshape(-1, 3)
        faces = np.array([[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]]) + 4 * np.arange(130)[:, None, None]
        found = assess(TriMesh(vertices, faces.reshape(-1, 3)))
        assert (len(found["per_component"]), found["components_not_listed"]) == (100, 30)
        np.testing.assert_allclose([own["shortest_edge_mm"] for own in found["per_component"]], scale[:29:-1, 0, 0])
        assert found["sound"]

    def test_a_soup_is_sound_after_welding(self) -> None:
        mesh = icosphere()
        soup = TriMesh(mesh.corners.reshape(-1, 3), np.arange(3 * len(mesh.faces)).reshape(-1, 3))
        found = assess(soup)
        assert (found["sound"], found["sound_after_welding"]) == (False, True)
        assert found["self_intersections"] == 0
        assert assess(welded(soup))["sound"]

    def test_tells_percents_and_may_be_stopped(self) -> None:
        told: list[tuple[str, int, int]] = []
        assess(icosphere(), points=sphere(50), progress=lambda *now: told.append(now))
        assert {(stage, total) for stage, _, total in told} == {("measure", 100)}
        assert [done for _, done, _ in told] == sorted(done for _, done, _ in told)
        assert told[-1][1] == 100

        def stop(_stage: str, _done: int, _total: int) -> None:
            raise KeyboardInterrupt

        with pytest.raises(KeyboardInterrupt):
            assess(icosphere(), progress=stop)
