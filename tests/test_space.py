"""One network in space: its own faces as a closed surface, judged by others."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import nibabel
import numpy as np
import pytest
import trimesh
from hypothesis import given
from hypothesis import strategies as st
from skimage.measure import marching_cubes

from conftest import law, seeds
from studies import rotation
from tomomesh import Volume, phantom, reconstruct, segment
from tomomesh.cli import main
from tomomesh.dynamics.subdivision import squares_of
from tomomesh.errors import EmptyError, GeometryError, UsageError
from tomomesh.measure.distance import distance_to_surface
from tomomesh.measure.intersections import CrossingFaces
from tomomesh.model.icosphere import icosphere
from tomomesh.model.lattice import lattice
from tomomesh.model.mesh import TriMesh
from tomomesh.model.networks import SpaceNetwork
from tomomesh.segmentation.space import MOST, is_wall, pieces_of, train_space, untangled
from tomomesh.settings import NetworkSettings

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from tomomesh.head_phantom import Phantom
    from tomomesh.results import Surface

TUBE, RING = 6.0, 15.0
TURNED = rotation(0.9, 0.4, 0.2)


def torus(turn: NDArray[np.float64] = TURNED) -> NDArray[np.uint8]:
    """Paint a torus that lies askew, its border blurred over a voxel, (48, 48, 48)."""
    x, y, z = np.tensordot(turn, np.indices((48, 48, 48))[::-1] - 23.5, 1)
    away = np.hypot(np.hypot(x, y) - RING, z)
    return np.asarray(np.rint(200 * np.clip(0.5 + TUBE - away, 0, 1)), np.uint8)


def ellipsoid() -> NDArray[np.uint8]:
    x, y, z = np.indices((30, 40, 50))[::-1] - np.array([24.5, 19.5, 14.5])[:, None, None, None]
    away = np.sqrt((x / 20) ** 2 + (y / 15) ** 2 + (z / 10) ** 2)
    return np.asarray(np.rint(200 * np.clip(0.5 + 12 * (1 - away), 0, 1)), np.uint8)


def volume_of(voxels: NDArray[Any]) -> Volume:
    return Volume.from_stored(voxels, np.eye(4))


def cubes_of(voxels: NDArray[Any], level: float = 100.0) -> TriMesh:
    """Return somebody else's surface of the same voxels, in (x, y, z)."""
    vertices, faces, _, _ = marching_cubes(np.pad(voxels, 1).astype(float), level)
    return TriMesh(vertices[:, ::-1].astype(float) - 1.0, faces.astype(np.int64))


def apart(one: TriMesh, other: TriMesh) -> float:
    """Return the greater of the mean distances there and back."""
    return max(float(distance_to_surface(a.vertices, b).mean()) for a, b in ((one, other), (other, one)))


def assert_sound(made: Surface, genus: int) -> None:
    mesh = trimesh.Trimesh(made.mesh.vertices, made.mesh.faces, process=False)
    assert mesh.is_watertight
    assert mesh.is_winding_consistent
    assert mesh.volume > 0
    assert mesh.euler_number == 2 - 2 * genus
    assert not CrossingFaces(0)(made.mesh).any()


@pytest.fixture(scope="module")
def ring() -> Surface:
    return reconstruct(volume_of(torus()), lower=100.0, network="torus", neurons=600)


@pytest.fixture(scope="module")
def head() -> Phantom:
    return phantom((27, 128, 128), (1.875, 1.875, 5.4))


class TestSquares:
    @given(frequency=st.integers(1, 5))
    def test_are_closed_and_keep_the_volume(self, frequency: int) -> None:
        vertices, faces = icosphere(frequency)
        found, quads = squares_of(TriMesh(vertices, faces))
        assert (len(found), len(quads)) == (len(vertices) + 5 * len(faces) // 2, 3 * len(faces))
        halves = trimesh.Trimesh(found, quads[:, [0, 1, 2, 0, 2, 3]].reshape(-1, 3), process=False)
        assert halves.is_watertight
        assert halves.volume == pytest.approx(trimesh.Trimesh(vertices, faces).volume)


class TestWindow:
    def test_of_a_shell_is_a_wall_and_of_a_torus_is_none(self) -> None:
        k, j, i = np.indices((40, 40, 40)) - 19.5
        away = np.sqrt(i**2 + j**2 + k**2)
        assert is_wall((away > 14) & (away < 17))
        assert not is_wall(away < 17)
        assert not is_wall(torus(np.eye(3)) > 100)

    def test_loses_its_small_pieces_alone(self) -> None:
        mask = np.zeros((10, 10, 20), bool)
        mask[:, :, :10], mask[1, 1, 14], mask[5:, 5:, 14:] = True, True, True
        kept, pieces = pieces_of(mask)
        assert pieces == 2
        assert np.argwhere(mask & ~kept).tolist() == [[1, 1, 14]]


class TestNetwork:
    def test_shows_a_regular_share_of_many_places(self) -> None:
        places = np.random.default_rng(0).normal(size=(2 * MOST + 7, 3))
        found = train_space(places, NetworkSettings(network="sphere", neurons=42, epochs=2), outlined=True)
        assert found.inputs == len(places[::3])

    def test_does_not_depend_on_where_the_patient_lies(self) -> None:
        places = np.random.default_rng(1).normal(size=(500, 3))
        asked = NetworkSettings(network="sphere", neurons=42)
        here, there = (train_space(places + far, asked, outlined=True).codebook - far for far in (0.0, 1e5))
        np.testing.assert_allclose(here, there, atol=1e-6)

    def test_refuses_more_neurons_than_places(self) -> None:
        with pytest.raises(EmptyError, match="fewer --neurons"):
            train_space(np.zeros((30, 3)), NetworkSettings(network="sphere"), outlined=True)


class TestSurface:
    def test_of_a_torus_askew_has_its_hole(self, ring: Surface) -> None:
        assert_sound(ring, genus=1)
        assert apart(ring.mesh, cubes_of(torus())) < 0.1
        assert ring.report["quality"]["volume_mm3"] == pytest.approx(2 * np.pi**2 * RING * TUBE**2, rel=0.01)
        assert len(ring.points) == len(lattice("torus", 600))

    def test_of_an_ellipsoid_is_near_marching_cubes(self) -> None:
        made = reconstruct(volume_of(ellipsoid()), lower=100.0, network="sphere", neurons=642)
        assert_sound(made, genus=0)
        assert apart(made.mesh, cubes_of(ellipsoid())) < 0.1
        assert made.report["quality"]["volume_mm3"] == pytest.approx(4 / 3 * np.pi * 20 * 15 * 10, rel=0.01)

    def test_is_drawn_to_the_nearest_points_where_asked(self) -> None:
        made = reconstruct(volume_of(ellipsoid()), lower=100.0, network="sphere", neurons=642, attraction="nearest")
        assert_sound(made, genus=0)
        assert apart(made.mesh, cubes_of(ellipsoid())) < 0.2

    def test_of_a_skull_is_its_middle(self, head: Phantom) -> None:
        made = reconstruct(head.volume, lower=head.lower, upper=head.upper, network="sphere", neurons=1002)
        assert_sound(made, genus=0)
        assert made.report["networks"]["signal"] == "region"
        assert distance_to_surface(head.truth.vertices, made.mesh).mean() < 0.5

    def test_of_a_head_is_near_its_boundary(self, head: Phantom) -> None:
        made = reconstruct(head.volume, lower=60.0, network="sphere", neurons=1002)
        assert_sound(made, genus=0)
        exact = reconstruct(head.volume, lower=60.0, network="none", surface="outer").mesh
        assert apart(made.mesh, exact) < 0.5 * head.volume.spacing_mm[0]
        assert made.report["networks"]["signal"] == "boundary"

    def test_repeats_on_any_number_of_threads(self, ring: Surface) -> None:
        again = reconstruct(volume_of(torus()), lower=100.0, network="torus", neurons=600, threads=1)
        np.testing.assert_array_equal(again.mesh.vertices, ring.mesh.vertices)
        np.testing.assert_array_equal(again.mesh.faces, ring.mesh.faces)

    def test_of_labels_is_that_of_their_voxels(self) -> None:
        labels = np.where(ellipsoid() > 100, 7, 0).astype(np.int16)
        made = reconstruct(volume_of(labels), select=(7,), network="sphere", neurons=642)
        assert_sound(made, genus=0)
        assert apart(made.mesh, cubes_of(labels, 3.5)) < 0.25
        assert made.segmentation is not None
        np.testing.assert_array_equal(made.segmentation.labels > 0, labels == 7)

    def test_warns_of_a_solid_that_is_shown_as_a_wall(self) -> None:
        asked: dict[str, Any] = {"lower": 100.0, "network": "sphere", "neurons": 162, "signal": "region"}
        with pytest.raises(GeometryError, match="does not follow what it was made from"):
            reconstruct(volume_of(ellipsoid()), **asked)
        made = reconstruct(volume_of(ellipsoid()), **asked, allow_leaks=True)
        assert_sound(made, genus=0)
        assert any("--signal boundary" in warning for warning in made.report["warnings"])
        assert any("of the volume of its window" in warning for warning in made.report["warnings"])

    @law(20)
    @given(seed=seeds, name=st.sampled_from(["sphere", "torus"]), noise=st.floats(0.1, 2.0))
    def test_a_tangled_network_goes_back_to_where_it_passes_through_itself_nowhere(
        self, seed: int, name: str, noise: float
    ) -> None:
        """Smoothing alone leaves some faces through others."""
        graph, rng = lattice(name, 162), np.random.default_rng(seed)
        shown = rng.normal(size=(500, 3)) * [9, 7, 5]
        codebook = 8 * (graph.places + rng.normal(0, noise, graph.places.shape))
        mesh, _ = untangled(SpaceNetwork(graph, codebook, True, 500, 0), shown)
        assert not CrossingFaces(1)(mesh).any()
        assert mesh.face_volumes.sum() > 0

    def test_faces_outward_from_a_mirrored_start(self) -> None:
        vertices, faces = icosphere(4)
        network = SpaceNetwork(replace(lattice("sphere", 162), faces=faces), -vertices, True, 162, 0)
        mesh, moved = untangled(network, -vertices)
        assert moved == 0
        assert mesh.face_volumes.sum() == pytest.approx(trimesh.Trimesh(vertices, faces).volume)

    def test_tells_what_it_leaves_out(self) -> None:
        voxels = np.pad(ellipsoid(), ((0, 0), (0, 0), (0, 12)))
        voxels[12:18, 15:24, -10:-3] = 200
        made = reconstruct(volume_of(voxels), lower=100.0, network="sphere", neurons=642)
        assert made.report["space"]["dropped_voxels"] == 6 * 9 * 7
        assert any("small pieces" in warning for warning in made.report["warnings"])


class TestOpenNetworks:
    @pytest.mark.parametrize("network", ["chain", "grid"])
    def test_lie_among_the_voxels(self, network: str) -> None:
        found = segment(volume_of(torus()), lower=100.0, network=network, space="volume", neurons=60)
        assert len(found.source.network.codebook) == 60
        assert len(found.points) == 60
        k, j, i = np.rint(found.points.positions[:, ::-1]).astype(int).T
        inside = torus()[k, j, i] > 100
        assert inside.mean() > 0.8
        assert found.report["space"] == {"pieces": 1, "dropped_voxels": 0}

    def test_bound_no_surface(self) -> None:
        with pytest.raises(UsageError, match="no faces"):
            reconstruct(volume_of(torus()), lower=100.0, network="grid", space="volume")

    def test_do_not_share_a_slice(self) -> None:
        with pytest.raises(UsageError, match="--network ring in slices"):
            NetworkSettings(contours="loops", space="volume")
        with pytest.raises(UsageError, match="no network to be in space"):
            NetworkSettings(network="none", space="volume")

    def test_have_neurons_enough(self) -> None:
        counts = [NetworkSettings(network=name).neuron_count for name in ("ring", "sphere", "torus")]
        assert counts == [58, 2562, 2562]
        assert NetworkSettings(network="chain", space="volume", neurons=9).neuron_count == 9


class TestCommandLine:
    @pytest.fixture
    def study(self, tmp_path: Path) -> str:
        flip = np.diag([-1.0, -1.0, 1.0, 1.0])
        nibabel.save(nibabel.Nifti1Image(ellipsoid().T, flip), tmp_path / "study.nii.gz")
        return str(tmp_path / "study.nii.gz")

    def test_writes_a_sphere(self, study: str, tmp_path: Path, capsys: Any) -> None:
        names = ("m.ply", "r.json", "l.nii.gz", "p.ply")
        mesh, report, labels, points = (str(tmp_path / name) for name in names)
        arguments = ["reconstruct", study, "-o", mesh, "--network", "sphere", "--neurons", "162", "--lower", "100"]
        more = ["--report", report, "--labels", labels, "--points", points, "--figures", str(tmp_path / "figures")]
        assert main([*arguments, *more]) == 0
        told = capsys.readouterr().out
        assert "a sphere of 162 neurons in space on the window's boundary" in told
        read = trimesh.load(mesh)
        assert read.is_watertight
        assert read.euler_number == 2
        assert json.loads(Path(report).read_text())["space"]["faces"] == 320
        assert np.asarray(nibabel.load(labels).dataobj).max() <= 162
        assert len(trimesh.load(points).vertices) == 162

    def test_refuses_a_surface_of_a_grid_in_one_line(self, study: str, tmp_path: Path, capsys: Any) -> None:
        arguments = ["reconstruct", study, "-o", str(tmp_path / "m.stl"), "--network", "grid", "--space", "volume"]
        assert main([*arguments, "--quiet"]) == 2
        told = capsys.readouterr().err
        assert told.count("\n") == 1
        assert "tomomesh segment" in told
        assert not (tmp_path / "m.stl").exists()

    def test_writes_the_points_of_a_chain(self, study: str, tmp_path: Path) -> None:
        arguments = ["segment", study, "-o", str(tmp_path / "p.ply"), "--network", "chain", "--space", "volume"]
        assert main([*arguments, "--neurons", "40", "--quiet"]) == 0
        assert len(trimesh.load(tmp_path / "p.ply").vertices) == 40
