"""Coarser meshes: what is promised of them, and what goes over to their faces."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING

import numpy as np
import pytest
import trimesh
from hypothesis import given
from hypothesis import strategies as st

from conftest import law, sphere, torus
from tomomesh import decimation, reconstruct_points
from tomomesh.cli import main
from tomomesh.decimation import decimate, faces_under
from tomomesh.errors import GeometryError, UsageError
from tomomesh.measure.report import compare
from tomomesh.measure.topology import check_promise, topology

if TYPE_CHECKING:
    from pathlib import Path

    from numpy.typing import NDArray

    from tomomesh.model.mesh import TriMesh

pytest.importorskip("fast_simplification", reason="the extra decimate is not installed")


@pytest.fixture(scope="module")
def ring() -> TriMesh:
    """A torus of 10 around a tube of 4, with a sphere beside it."""
    parts = np.concatenate([torus(4000), sphere(1500, 3.0) + np.array([30, 0, 0])])
    return reconstruct_points(parts).mesh


def nested() -> NDArray[np.float64]:
    """A sphere in a sphere."""
    return np.concatenate([sphere(4000), sphere(1500, 5.0)])


class TestPromise:
    @law(12)
    @given(share=st.floats(0.02, 0.99))
    def test_closed_manifold_of_the_same_shape_and_few_enough(self, ring: TriMesh, share: float) -> None:
        most = int(share * len(ring.faces))
        found = decimate(ring, most)
        assert 0.95 * most - 4 <= len(found.faces) <= most
        check_promise(found)
        judged = trimesh.Trimesh(found.vertices, found.faces, process=True)
        assert judged.is_watertight
        assert judged.is_winding_consistent
        assert (judged.body_count, judged.euler_number) == (2, 2)

    def test_the_error_falls_with_the_area_of_a_face(self, ring: TriMesh) -> None:
        errors = [compare(decimate(ring, most), ring)["mean_mm"] for most in (500, 2000, 8000)]
        assert errors[0] > 2.5 * errors[1] > 6 * errors[2]
        assert errors[1] < 0.03

    def test_unit_and_place_change_nothing(self, ring: TriMesh) -> None:
        one = decimate(ring, 1000)
        other = decimate(ring.moved(ring.vertices * 1024 + 4096), 1000)
        np.testing.assert_array_equal(one.faces, other.faces)
        np.testing.assert_allclose(other.vertices, one.vertices * 1024 + 4096, atol=1e-6)

    def test_the_bytes_repeat(self, ring: TriMesh) -> None:
        one, other = decimate(ring, 1000, threads=1), decimate(ring, 1000, threads=2)
        assert one.vertices.tobytes() == other.vertices.tobytes()
        assert one.faces.tobytes() == other.faces.tobytes()

    def test_too_few_for_the_shape_are_refused(self, ring: TriMesh) -> None:
        with pytest.raises(GeometryError, match=r"--target-faces = 4.*about \d+ or more") as caught:
            decimate(ring, 4)
        least = int(str(caught.value).split("about ")[1].split()[0])
        assert 4 < least < 100
        assert topology(decimate(ring, 2 * least)).genus == 1

    def test_the_lining_of_a_cavity_stays(self) -> None:
        found = reconstruct_points(nested(), surface="all", target_faces=900)
        assert len(found.mesh.faces) <= 900
        assert found.report["surface"]["cavities"] == 1
        assert found.report["quality"]["sound"]
        assert found.report["quality"]["volume_mm3"] == pytest.approx(4 / 3 * np.pi * (1000 - 125), rel=0.03)


class TestMarks:
    def test_a_filled_hole_stays_marked(self) -> None:
        points = sphere(3000)
        found = reconstruct_points(points[points[:, 2] < 9.6], target_faces=2000)
        assert found.filled is not None
        assert len(found.filled) == len(found.mesh.faces)
        middle = found.mesh.corners.mean(axis=1)
        assert (middle[found.filled, 2] > 8.5).all()
        assert found.filled[np.hypot(middle[:, 0], middle[:, 1]) < 1][middle[np.hypot(*middle.T[:2]) < 1, 2] > 0].all()

    def test_the_nearest_face_of_the_same_mesh_is_the_face_itself(self, ring: TriMesh) -> None:
        np.testing.assert_array_equal(faces_under(ring, ring), np.arange(len(ring.faces)))


class TestDoor:
    def test_the_report_is_that_of_the_coarse_mesh(self, tmp_path: Path) -> None:
        np.save(tmp_path / "c.npy", sphere(1000))
        line = ["surface", str(tmp_path / "c.npy"), "-o", str(tmp_path / "m.ply"), "--target-faces", "300", "--quiet"]
        assert main([*line, "--report", str(tmp_path / "r.json")]) == 0
        first = (tmp_path / "m.ply").read_bytes()
        report = json.loads((tmp_path / "r.json").read_text())
        mesh = trimesh.load(tmp_path / "m.ply")
        assert report["quality"]["faces"] == len(mesh.faces) == 300
        assert report["quality"]["volume_mm3"] == pytest.approx(mesh.volume)
        assert report["timings"]["decimate_s"] > 0
        assert main([*line, "--threads", "1"]) == 0
        assert first == (tmp_path / "m.ply").read_bytes()

    def test_a_mesh_that_is_coarse_enough_stays(self) -> None:
        one, other = reconstruct_points(sphere(500)), reconstruct_points(sphere(500), target_faces=10_000)
        assert one.mesh.vertices.tobytes() == other.mesh.vertices.tobytes()
        assert "decimate_s" not in other.report["timings"]

    def test_a_missing_package_is_told_before_any_work(self, monkeypatch: pytest.MonkeyPatch) -> None:
        monkeypatch.setattr(decimation, "PACKAGE", "there_is_no_such_package")
        with pytest.raises(UsageError, match=r'fast-simplification.*pip install "tomomesh\[decimate\]"'):
            reconstruct_points(np.zeros((0, 3)), target_faces=100)
