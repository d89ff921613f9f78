"""A scene of 3D Slicer: its files found as Slicer finds them, and both placed where they belong.

No Slicer is here. The scene is read by rules of its storage nodes: names relative to the scene, decoded in the opposite
order of their encoding; a mesh in RAS unless its node says LPS. SimpleITK, whose readers Slicer has, places the study.
"""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any
from xml.etree import ElementTree

import nibabel
import numpy as np
import pytest
import SimpleITK
import trimesh

from doors import refused
from studies import LPS_TO_RAS, rotation, write_series
from tomomesh import read_mesh
from tomomesh.cli import main
from tomomesh.errors import GeometryError
from tomomesh.io.slicer import ENCODED, require_same_place
from tomomesh.model.volume import Volume

if TYPE_CHECKING:
    from numpy.typing import NDArray

SHAPE = (14, 18, 22)
SPACING = (1.5, 2.0, 2.5)


def affine(x: float = 0.0, y: float = 0.0, z: float = 0.0) -> NDArray[np.float64]:
    """Return a turned frame, LPS, far from 0."""
    found = np.eye(4)
    found[:3, :3] = rotation(x, y, z) * SPACING
    found[:3, 3] = (-31.0, 47.0, 12.0)
    return found


def ball() -> NDArray[np.int16]:
    """Return voxels (K, J, I) of an ellipsoid that is nowhere near the middle."""
    k, j, i = np.indices(SHAPE)
    return np.where(((k - 5) / 3.4) ** 2 + ((j - 11) / 4.6) ** 2 + ((i - 8) / 6.2) ** 2 <= 1, 200, 0).astype(np.int16)


class Scene:
    """A scene, as Slicer reads it."""

    def __init__(self, path: Path) -> None:
        self.folder = path.parent
        self.root = ElementTree.fromstring(path.read_bytes())
        self.nodes = {node.get("id"): node for node in self.root}

    def stored(self, tag: str) -> ElementTree.Element:
        """Return the storage node of what has a tag, by its references."""
        (node,) = self.root.findall(tag)
        references = dict(one.split(":") for one in (node.get("references") or "").split(";") if one)
        assert self.nodes[references["display"]].tag.endswith("Display")
        return self.nodes[references["storage"]]

    def file(self, name: str) -> Path:
        assert not Path(name).is_absolute()
        for plain, written in reversed(ENCODED.items()):
            name = name.replace(written, plain)
        return self.folder / name

    def mesh(self) -> tuple[NDArray[np.float64], Path]:
        """Return the vertices of the mesh in RAS, and its file."""
        node = self.stored("Model")
        path = self.file(node.attrib["fileName"])
        vertices = np.asarray(trimesh.load(path, process=False).vertices)
        return vertices * ([-1, -1, 1] if node.get("coordinateSystem") == "LPS" else [1, 1, 1]), path

    def study(self) -> tuple[NDArray[np.float64], NDArray[np.bool_]]:
        """Return places of every fifth voxel in RAS, and which are kept, as SimpleITK reads the files in order."""
        node = self.stored("Volume")
        members = [node.get(f"fileListMember{n}") for n in range(len(node.attrib))]
        names = [str(self.file(name)) for name in members if name] or [str(self.file(node.attrib["fileName"]))]
        image: Any = SimpleITK.ReadImage(names if len(names) > 1 else names[0])
        levels = SimpleITK.GetArrayFromImage(image)
        index = np.argwhere(np.ones(levels.shape, bool))[::5]
        places = [image.TransformContinuousIndexToPhysicalPoint(one[::-1].astype(float).tolist()) for one in index]
        return np.array(places) * [-1, -1, 1], levels[tuple(index.T)] > 100


def windings(places: NDArray[np.float64], corners: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return how often triangles (m, 3, 3) wind around places, by their solid angles (van Oosterom & Strackee 1983)."""
    a, b, c = (corners[None, :, n] - places[:, None] for n in range(3))
    la, lb, lc = (np.linalg.norm(one, axis=2) for one in (a, b, c))
    ab, bc, ca = ((one * other).sum(axis=2) for one, other in ((a, b), (b, c), (c, a)))
    solid = np.arctan2((a * np.cross(b, c)).sum(axis=2), la * lb * lc + ab * lc + bc * la + ca * lb)
    return np.asarray(solid.sum(axis=1) / (2 * np.pi))


def require_together(scene: Scene) -> None:
    """Check that the voxels that are kept lie in the mesh, and no others."""
    (vertices, path), (places, kept) = scene.mesh(), scene.study()
    faces = np.asarray(trimesh.load(path, process=False).faces)
    assert kept.sum() > 50
    np.testing.assert_allclose(windings(places, vertices[faces]), kept, atol=1e-3)


def made(study: Path, mesh: Path, scene: Path, *options: str) -> Scene:
    line = ["reconstruct", str(study), "-o", str(mesh), "--slicer", str(scene), "--way", "voxels", "--lower", "100"]
    assert main([*line, "--quiet", *options]) == 0
    return Scene(scene)


@pytest.fixture
def nifti(tmp_path: Path) -> Path:
    folder = tmp_path / "scans of 'a' & 50%20"
    folder.mkdir()
    image = nibabel.Nifti1Image(ball().transpose(2, 1, 0), LPS_TO_RAS @ affine(0.3, -0.2, 0.5))
    nibabel.save(image, folder / "ça <t>.nii.gz")
    return folder / "ça <t>.nii.gz"


class TestPlaced:
    @pytest.mark.parametrize("frame", ["lps", "ras"])
    @pytest.mark.parametrize("suffix", ["stl", "ply", "obj"])
    def test_mesh_and_study_lie_together(self, nifti: Path, tmp_path: Path, suffix: str, frame: str) -> None:
        scene = made(nifti, tmp_path / f"m.{suffix}", nifti.parent / "s.mrml", "--frame", frame)
        require_together(scene)
        other = made(nifti, tmp_path / "other.ply", tmp_path / "o.mrml")
        np.testing.assert_allclose(scene.mesh()[0].mean(axis=0), other.mesh()[0].mean(axis=0), atol=1e-3)

    def test_vertices_are_those_of_the_mesh_in_ras(self, nifti: Path, tmp_path: Path) -> None:
        vertices, path = made(nifti, tmp_path / "m.ply", tmp_path / "s.mrml").mesh()
        np.testing.assert_array_equal(vertices, read_mesh(path).vertices * [-1, -1, 1])

    def test_a_series_goes_slice_by_slice(self, tmp_path: Path) -> None:
        """Its files are named one by one, as a folder may hold other series, and in the order of the slices."""
        folder = tmp_path / "ct"
        folder.mkdir()
        write_series(folder, ball(), affine(0.3, -0.2, 0.5))
        scene = made(folder, tmp_path / "m.stl", tmp_path / "s.mrml")
        node = scene.stored("Volume")
        assert len([name for name in node.attrib if name.startswith("fileListMember")]) == SHAPE[0]
        require_together(scene)

    def test_all_planes_show_the_study(self, nifti: Path, tmp_path: Path) -> None:
        scene = made(nifti, tmp_path / "m.vtp", tmp_path / "s.mrml")
        shown = {node.get("singletonTag"): node.get("backgroundVolumeID") for node in scene.root.iter("SliceComposite")}
        (volume,) = scene.root.findall("Volume")
        assert shown == dict.fromkeys(("Red", "Yellow", "Green"), volume.get("id"))
        assert len(scene.nodes) == len(scene.root)

    def test_moves_with_its_files(self, nifti: Path, tmp_path: Path) -> None:
        made(nifti, nifti.parent / "m.stl", nifti.parent / "s.mrml")
        nifti.parent.rename(tmp_path / "elsewhere")
        require_together(Scene(tmp_path / "elsewhere" / "s.mrml"))

    def test_the_same_bytes_again(self, nifti: Path, tmp_path: Path) -> None:
        first = made(nifti, tmp_path / "m.stl", tmp_path / "s.mrml")
        text = (tmp_path / "s.mrml").read_bytes()
        again = made(nifti, tmp_path / "m.stl", tmp_path / "s.mrml")
        assert first.folder == again.folder
        assert (tmp_path / "s.mrml").read_bytes() == text


class TestRefused:
    def line(self, study: Path, folder: Path, *options: str, mesh: str = "m.stl", scene: str = "s.mrml") -> list[str]:
        return ["reconstruct", str(study), "-o", str(folder / mesh), "--slicer", str(folder / scene), *options]

    @pytest.mark.parametrize(
        ("options", "more", "said"),
        [
            ((), {"mesh": "m.glb"}, "does not read such a mesh"),
            ((), {"scene": "s.xml"}, "suffix"),
            (("--frame", "voxel"), {}, "in the patient"),
            (("--spacing", "1,1,1"), {}, "no other place"),
            (("--each",), {}, "for one mesh"),
            (("--slab", "5"), {}, "study whole"),
        ],
    )  # fmt: skip
    def test_before_any_work(
        self, nifti: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str], options: tuple[str, ...],
        more: dict[str, str], said: str,
    ) -> None:  # fmt: skip
        assert said in refused(self.line(nifti, tmp_path, *options, **more), 2, tmp_path, capsys)

    def test_what_slicer_does_not_open(self, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
        np.save(tmp_path / "v.npy", ball())
        assert "does not open" in refused(self.line(tmp_path / "v.npy", tmp_path), 2, tmp_path, capsys)

    def test_a_zip(self, nifti: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
        import zipfile

        with zipfile.ZipFile(tmp_path / "z.zip", "w") as archive:
            archive.write(nifti, "a.nii.gz")
        assert "does not open" in refused(self.line(tmp_path / "z.zip", tmp_path), 2, tmp_path, capsys)

    def test_a_stream(self, nifti: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
        line = ["reconstruct", str(nifti), "-o", "-", "--format", "stl", "--slicer", str(tmp_path / "s.mrml")]
        assert "--slicer beside a stream" in refused(line, 2, tmp_path, capsys)

    def test_slices_that_are_not_stacked_square(self, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
        """Slicer's readers have no shear: a tilted gantry would be straightened, and the mesh lie elsewhere."""
        tilted = affine()
        tilted[1, 2] += 0.5
        folder = tmp_path / "ct"
        folder.mkdir()
        write_series(folder, ball(), tilted)
        assert "not stacked square" in refused(self.line(folder, tmp_path), 5, tmp_path, capsys)

    def test_slices_that_no_file_has(self, tmp_path: Path) -> None:
        volume = Volume.from_stored(ball(), affine())
        require_same_place(volume, [tmp_path] * SHAPE[0], file="ct")
        with pytest.raises(GeometryError, match="13 files for 14 slices"):
            require_same_place(volume, [tmp_path] * (SHAPE[0] - 1), file="ct")
