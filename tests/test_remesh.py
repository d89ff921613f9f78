"""Even triangles: what is promised of them, what goes over to them, and how few they may be."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING

import numpy as np
import pytest
import trimesh
from hypothesis import given
from hypothesis import strategies as st
from scipy import ndimage

from conftest import law, seeds, size, sphere, torus
from tomomesh import PointSet, Volume, reconstruct, reconstruct_points
from tomomesh.cli import main
from tomomesh.errors import GeometryError
from tomomesh.measure.intersections import self_intersections
from tomomesh.measure.report import compare
from tomomesh.measure.topology import check_promise, topology
from tomomesh.measure.winding import linings
from tomomesh.model.mesh import TriMesh
from tomomesh.remeshing.remesh import faces_under, remesh
from tomomesh.remeshing.specks import FEWEST

if TYPE_CHECKING:
    from pathlib import Path

    from numpy.typing import NDArray


@pytest.fixture(scope="module")
def ring() -> TriMesh:
    """A torus of 10 around a tube of 4, with a sphere beside it."""
    parts = np.concatenate([torus(4000), sphere(1500, 3.0) + np.array([30, 0, 0])])
    return reconstruct_points(parts, remesh=False).mesh


def blob(seed: int, rough: float = 2.0) -> TriMesh:
    """Return the boundary of a smooth random solid, as the voxels' way leaves it."""
    field = ndimage.gaussian_filter(np.random.default_rng(seed).normal(size=(18, 18, 18)), rough)
    volume = Volume.from_stored(np.pad(field, 2, constant_values=field.min()).astype(np.float32), np.eye(4))
    made = reconstruct(volume, lower=float(np.quantile(field, 0.7)), network="none", remesh=False)
    return made.mesh


def box(count: int, sides: tuple[float, float, float] = (1.0, 1.0, 1.0)) -> TriMesh:
    """Return a box whose longest sides are divided into so many squares."""
    cells = np.maximum(np.rint(np.array(sides) / max(sides) * count), 1).astype(int)
    made = trimesh.creation.box(extents=sides)
    while made.edges_unique_length.max() > 2**0.5 * max(sides) / cells.max() + 1e-9:
        made = made.subdivide()
    return TriMesh(made.vertices, made.faces)


def ball(radius: float, center: tuple[float, float, float] = (0.0, 0.0, 0.0)) -> TriMesh:
    """Return an icosphere of 5,120 faces."""
    made = trimesh.creation.icosphere(4, radius)
    return TriMesh(made.vertices + np.array(center), made.faces)


def turned_over(mesh: TriMesh) -> TriMesh:
    return TriMesh(mesh.vertices, mesh.faces[:, ::-1])


def merged(*meshes: TriMesh) -> TriMesh:
    """Return several meshes as one."""
    first = np.cumsum([0, *(len(mesh.vertices) for mesh in meshes)])
    faces = [mesh.faces + n for mesh, n in zip(meshes, first[:-1], strict=True)]
    return TriMesh(np.concatenate([mesh.vertices for mesh in meshes]), np.concatenate(faces))


def smallest(mesh: TriMesh) -> NDArray[np.float64]:
    """Return the smallest angle of each face in degrees, by the law of cosines."""
    sides = np.sort(np.linalg.norm(mesh.corners - np.roll(mesh.corners, 1, axis=1), axis=2), axis=1)
    a, b, c = sides.T
    return np.asarray(np.degrees(np.arccos(np.clip((b**2 + c**2 - a**2) / (2 * b * c), -1, 1))))


def same_kind(before: TriMesh, after: TriMesh) -> None:
    """Check that a mesh is what is promised, and has the components and handles of another."""
    check_promise(after, cavities=linings(before))
    one, other = topology(before), topology(after)
    assert (other.components, other.euler_number) == (one.components, one.euler_number)
    assert not self_intersections(after).any()


class TestShape:
    @law(20)
    @given(seed=seeds)
    def test_even_and_where_it_was(self, seed: int) -> None:
        before = blob(seed)
        found = remesh(before)
        same_kind(before, found.mesh)
        few = 3 if found.kept else 1  # triangles that are kept where sheets nearly touch are as they were
        assert np.percentile(smallest(found.mesh), few) >= 25
        assert np.median(smallest(found.mesh)) >= 45
        apart = compare(found.mesh, before)
        assert apart["mean_mm"] <= 0.03 * found.edge
        assert apart["back_mean_mm"] <= 0.03 * found.edge
        assert found.mesh.face_volumes.sum() == pytest.approx(before.face_volumes.sum(), rel=0.01)

    @law(10)
    @given(seed=seeds)
    def test_rough_solids_stay_closed_and_cross_nothing(self, seed: int) -> None:
        before = blob(seed, 0.6)
        same_kind(before, remesh(before).mesh)

    @pytest.mark.parametrize("shape", ["sphere", "torus"])
    def test_round_shapes(self, shape: str) -> None:
        before = reconstruct_points(sphere(size(4000, 1000)) if shape == "sphere" else torus(4000), remesh=False).mesh
        found = remesh(before)
        same_kind(before, found.mesh)
        assert len(found.mesh.faces) < len(before.faces)
        assert np.percentile(smallest(found.mesh), 1) >= 30
        assert found.mesh.face_volumes.sum() == pytest.approx(before.face_volumes.sum(), rel=0.005)

    @pytest.mark.parametrize("sides", [(1.0, 1.0, 1.0), (1.0, 1.0, 0.25)])
    def test_sharp_edges_stay_sharp(self, sides: tuple[float, float, float]) -> None:
        before = box(16, sides)
        found = remesh(before)
        same_kind(before, found.mesh)
        assert found.mesh.face_volumes.sum() == pytest.approx(np.prod(sides), rel=1e-9)
        assert compare(before, found.mesh)["max_mm"] <= 0.1 * found.edge
        assert np.percentile(smallest(found.mesh), 1) >= 25

    def test_a_thin_plate_keeps_its_two_sides(self) -> None:
        before = box(32, (1.0, 1.0, 1 / 32))
        found = remesh(before)
        same_kind(before, found.mesh)
        assert found.mesh.face_volumes.sum() == pytest.approx(1 / 32, rel=0.005)

    def test_the_smallest_meshes_stay(self) -> None:
        corner = TriMesh(np.eye(4, 3, -1), np.array([[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]]))
        round_ = trimesh.creation.icosahedron()
        for before in (corner, TriMesh(round_.vertices, round_.faces)):
            for edge in (None, 0.3, 10.0):
                same_kind(before, remesh(before, edge=edge).mesh)

    def test_one_voxel(self) -> None:
        voxels = np.zeros((3, 3, 3), np.float32)
        voxels[1, 1, 1] = 1
        made = reconstruct(Volume.from_stored(voxels, np.eye(4)), lower=0.5, network="none")
        assert made.report["quality"]["sound"]
        assert len(made.mesh.faces) >= 8

    def test_unit_and_place_change_nothing(self, ring: TriMesh) -> None:
        one, other = remesh(ring), remesh(ring.moved(ring.vertices * 1024))
        np.testing.assert_array_equal(one.mesh.faces, other.mesh.faces)
        np.testing.assert_allclose(other.mesh.vertices, one.mesh.vertices * 1024, atol=1e-6)

    def test_the_bytes_repeat_on_any_number_of_threads(self, ring: TriMesh) -> None:
        one, other = remesh(ring, threads=1).mesh, remesh(ring, threads=3).mesh
        assert one.vertices.tobytes() == other.vertices.tobytes()
        assert one.faces.tobytes() == other.faces.tobytes()

    def test_whoever_listens_may_stop_it(self, ring: TriMesh) -> None:
        def stop(stage: str, done: int, total: int) -> None:
            assert stage == "remesh"
            if done == total // 2:
                raise KeyboardInterrupt

        with pytest.raises(KeyboardInterrupt):
            remesh(ring, progress=stop)


class TestEdge:
    @law(8)
    @given(edge=st.floats(0.4, 3.0))
    def test_edges_are_about_as_long_as_asked(self, ring: TriMesh, edge: float) -> None:
        found = remesh(ring, edge=edge)
        same_kind(ring, found.mesh)
        assert found.edge == pytest.approx(edge, rel=0.15)

    def test_finer_edges_lie_nearer(self, ring: TriMesh) -> None:
        errors = [compare(remesh(ring, edge=edge).mesh, ring)["mean_mm"] for edge in (2.0, 1.0, 0.5)]
        assert errors[0] > 2.5 * errors[1] > 6 * errors[2]


class TestCoincident:
    @pytest.mark.parametrize("seed", [104, 108, 110, 140])
    def test_vertices_come_to_lie_at_no_position_of_another(self, seed: int) -> None:
        """A net without springs in noise has corners so sharp that a vertex moved onto one that was kept."""
        source = np.random.default_rng(seed)
        noise = ndimage.gaussian_filter(source.normal(size=source.integers(8, 26, 3)), source.uniform(1, 3))
        levels = (1000 * noise / np.abs(noise).max()).astype(np.int16)
        volume = Volume.from_stored(levels, np.eye(4))
        made = reconstruct(volume, lower=float(np.percentile(levels, 60)), way="voxels", stiffness=0.0)
        assert made.report["remesh"]["done"]
        assert len(np.unique(made.mesh.vertices, axis=0)) == len(made.mesh.vertices)
        assert made.report["quality"]["self_intersections"] == 0


class TestFewer:
    @law(12)
    @given(share=st.floats(0.02, 0.99))
    def test_closed_manifold_of_the_same_shape_and_few_enough(self, ring: TriMesh, share: float) -> None:
        most = int(share * len(ring.faces))
        found = remesh(ring, most=most).mesh
        assert 0.75 * min(most, len(remesh(ring).mesh.faces)) <= len(found.faces) <= most
        check_promise(found)
        judged = trimesh.Trimesh(found.vertices, found.faces, process=True)
        assert judged.is_watertight
        assert judged.is_winding_consistent
        assert (judged.body_count, judged.euler_number) == (2, 2)

    def test_too_few_for_the_shape_are_refused(self, ring: TriMesh) -> None:
        with pytest.raises(GeometryError, match=r"--target-faces = 4.*\d+ or more.*Try: --target-faces") as caught:
            remesh(ring, most=4)
        least = int(str(caught.value).split("Expected: ")[1].split()[0])
        assert 4 < least < 150
        assert topology(remesh(ring, most=least).mesh).genus == 1

    def test_the_number_that_is_named_keeps_the_shape(self, ring: TriMesh) -> None:
        with pytest.raises(GeometryError, match="of the volume") as caught:
            remesh(ring, most=30, like=1.02)
        least = int(str(caught.value).split("Expected: ")[1].split()[0])
        found = remesh(ring, most=least, like=1.02)
        assert len(found.mesh.faces) <= least < len(ring.faces)
        assert found.mesh.face_volumes.sum() == pytest.approx(found.before.face_volumes.sum(), rel=0.02)

    def test_specks_and_small_linings_are_left_out(self) -> None:
        """A ball with a wide cavity, in which a grain floats, and with a pore; and grains around it."""
        grain, grains = ball(0.3), [ball(0.2, (14.0, y, 0.0)) for y in (-4.0, 0.0, 4.0)]
        pore = ball(0.3, (8.0, 0.0, 0.0))
        cavity = ball(5.0)
        whole = merged(ball(10.0), turned_over(cavity), grain, turned_over(pore), *grains)
        found = remesh(whole, most=1000)
        assert (found.left_out.pieces, found.left_out.linings) == (5, 1)
        assert topology(found.mesh, cavities=1).sound
        assert topology(found.mesh, cavities=1).components == 2
        assert found.mesh.face_volumes.sum() == pytest.approx(4 / 3 * np.pi * (1000 - 125), rel=0.03)
        assert "5 components are too small" in found.warnings[0]
        assert remesh(whole, most=len(whole.faces)).left_out.pieces == 0

    def test_what_floats_in_a_cavity_goes_with_it(self) -> None:
        """A rough grain of more area than the cavity around it is left out with that: faces enough, and no place."""
        rough = ball(0.95)
        rough = rough.moved(rough.vertices * np.random.default_rng(0).uniform(0.5, 1.0, (len(rough.vertices), 1)))
        solid, cavity = ball(20.0), turned_over(ball(1.0))
        areas = [float(part.face_areas.sum()) for part in (solid, rough, cavity)]
        assert areas[1] > 1.2 * areas[2]
        most = int(1.1 * FEWEST * (areas[0] + areas[1]) / areas[1])
        found = remesh(merged(solid, cavity, rough), most=most)
        assert (found.left_out.pieces, found.left_out.linings) == (2, 1)
        assert topology(found.mesh).sound

    def test_the_lining_of_a_cavity_stays(self) -> None:
        nested = np.concatenate([sphere(4000), sphere(1500, 5.0)])
        found = reconstruct_points(nested, surface="all", target_faces=900)
        assert len(found.mesh.faces) <= 900
        assert found.report["surface"]["cavities"] == 1
        assert found.report["quality"]["sound"]
        assert found.report["quality"]["volume_mm3"] == pytest.approx(4 / 3 * np.pi * (1000 - 125), rel=0.03)


class TestMarks:
    def test_a_filled_hole_stays_marked(self) -> None:
        points = sphere(3000)
        found = reconstruct_points(points[points[:, 2] < 9.6])
        assert found.filled is not None
        assert len(found.filled) == len(found.mesh.faces)
        middle = found.mesh.corners.mean(axis=1)
        assert (middle[found.filled, 2] > 8.5).all()
        assert found.filled[np.hypot(middle[:, 0], middle[:, 1]) < 1][middle[np.hypot(*middle.T[:2]) < 1, 2] > 0].all()

    def test_the_nearest_face_of_the_same_mesh_is_the_face_itself(self, ring: TriMesh) -> None:
        np.testing.assert_array_equal(faces_under(ring, ring), np.arange(len(ring.faces)))

    def test_borders_of_a_sheet_stay_where_they_are(self) -> None:
        points = sphere(3000)
        cut = PointSet.from_positions(points[points[:, 2] > 0])
        before, after = (reconstruct_points(cut, open=True, remesh=even).mesh for even in (False, True))
        assert borders(after) == borders(before) != set()
        assert topology(after).euler_number == topology(before).euler_number


class TestDoor:
    def test_the_report_is_that_of_the_coarse_mesh(self, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
        np.save(tmp_path / "c.npy", sphere(1000))
        line = ["surface", str(tmp_path / "c.npy"), "-o", str(tmp_path / "m.ply"), "--target-faces", "300"]
        assert main([*line, "--report", str(tmp_path / "r.json")]) == 0
        first = (tmp_path / "m.ply").read_bytes()
        report = json.loads((tmp_path / "r.json").read_text())
        mesh = trimesh.load(tmp_path / "m.ply")
        assert report["quality"]["faces"] == len(mesh.faces) <= 300
        assert report["quality"]["volume_mm3"] == pytest.approx(mesh.volume)
        assert report["quality"]["p1_smallest_angle_deg"] >= 25
        assert report["remesh"]["faces_before"] > 300
        assert report["timings"]["remesh_s"] > 0
        assert f"triangles edges of {report['remesh']['edge_mm']:.3g} mm, smallest angles" in capsys.readouterr().out
        assert main([*line, "--threads", "1"]) == 0
        assert first == (tmp_path / "m.ply").read_bytes()

    def test_the_triangles_of_the_way_are_left_where_asked(self) -> None:
        made = reconstruct_points(sphere(500), remesh=False)
        assert "remesh" not in made.report
        assert len(made.mesh.faces) == len(made.smoothed.faces)


def borders(mesh: TriMesh) -> set[tuple[tuple[float, ...], ...]]:
    """Return the places of the two ends of each border edge."""
    directed = {(int(a), int(b)) for a, b in mesh.half_edges}
    ends = [(a, b) for a, b in directed if (b, a) not in directed]
    return {(tuple(mesh.vertices[a]), tuple(mesh.vertices[b])) for a, b in ends}
