"""Nothing is written that does not follow its window: far meshes are refused, near misses are told first of all."""

from __future__ import annotations

from dataclasses import replace
from functools import cache, lru_cache
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy import ndimage

from conftest import COMPILED, law, seeds
from studies import write_nifti
from test_end_to_end import judged
from tomomesh import Settings, Volume, phantom, read_volume, reconstruct, reconstruct_points
from tomomesh.cli import main
from tomomesh.errors import GeometryError
from tomomesh.finish import finish
from tomomesh.followed import boundary_followed, outline_followed
from tomomesh.judgement import LIMITS, OFF, TOLD, follow
from tomomesh.progress import silent

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from tomomesh.results import Surface

SHARED = Path(__file__).resolve().parents[2] / "shared" / "data"
LABELS = SHARED / "derived" / "dev54_synth_t1" / "dev54_synth_t1_labels.nii.gz"
MR = SHARED / "derived" / "dev54_t1" / "dev54_t1.nii.gz"
CT = SHARED / "dicom2stl" / "ct_example.nii.gz"
ASKED: dict[str, dict[str, Any]] = {
    "rings": {"way": "ring"}, "loops": {"contours": "loops"}, "components": {"contours": "components"},
    "voxels": {"network": "none"}, "sphere": {"network": "sphere", "neurons": 162},
}  # fmt: skip


def smooth_noise(seed: int, shape: tuple[int, int, int], width: float) -> NDArray[np.float32]:
    """Return gray levels with blobs of a width in voxels; 0 is their mean."""
    noise = np.random.default_rng(seed).normal(size=shape)
    return np.asarray(ndimage.gaussian_filter(noise, width) if width else noise, np.float32)


def balls(*middles: tuple[float, float, float], radius: float = 9.0, size: int = 48) -> Volume:
    """Return balls in a box, their gray levels falling outward from 100 over a voxel."""
    places = np.indices((size, size, size))
    away = np.min([np.sqrt(sum((places[n] - one[n]) ** 2 for n in range(3))) for one in middles], axis=0)
    return Volume.from_stored((100 * np.clip(radius + 0.5 - away, 0, 1)).astype(np.float32), np.eye(4))


ONE, TWO = ((23.5, 23.5, 23.5),), ((23.5, 23.5, 11.0), (23.5, 23.5, 36.0))
FIVE = (*((z, y, 23.5) for z in (7.5, 39.5) for y in (7.5, 39.5)), (23.5, 23.5, 39.5))
"""Middles of a ball, of two that lie side by side in every slice, and of five in several directions."""


@cache
def whole() -> Surface:
    """Return the mesh of one ball."""
    return reconstruct(balls(*ONE), lower=50.0, network="none")


@lru_cache(maxsize=1)
def study_of(path: Path) -> Volume:
    """Return a study, read once for the tests of it that follow one another."""
    return read_volume(path)


def followed(made: Surface) -> dict[str, Any]:
    told: dict[str, Any] = made.report["quality"]["follows"]
    return told


class TestMeasure:
    @law(20)
    @given(seed=seeds, spacing=st.tuples(*[st.floats(0.3, 4.0)] * 3), moved=st.floats(0.0, 6.0))
    def test_a_mesh_that_is_moved_is_as_far_as_it_was_moved(
        self, seed: int, spacing: tuple[float, float, float], moved: float
    ) -> None:
        """A box of voxels against itself: exact, whatever the lattice is."""
        rng = np.random.default_rng(seed)
        mask = np.zeros((12, 12, 12), bool)
        mask[2:10, 2:10, 2:10] = True
        turn = np.linalg.qr(rng.normal(size=(3, 3)))[0]
        affine = np.eye(4)
        affine[:3, :3], affine[:3, 3] = turn * spacing, rng.normal(size=3) * 100
        volume = Volume.from_stored(mask.astype(np.uint8), affine)
        follows = boundary_followed(volume.voxels > 0, volume)
        box = reconstruct(volume, lower=0.5, network="none", divide=False).segmentation
        assert box is not None
        cube = box.source.cuberille.triangulated()
        apart = follows.apart(cube)
        assert apart.share == pytest.approx(1)
        assert apart.offset == pytest.approx(0, abs=1e-9)
        np.testing.assert_allclose(apart.back, 0, atol=1e-9)
        assert apart.there.max() <= np.sqrt(0.5) + 1e-9
        step = volume.affine[:3, 2] * moved
        again = follows.apart(cube.moved(cube.vertices + step))
        assert again.back.max() == pytest.approx(moved, abs=1e-6)
        assert again.there.max() == pytest.approx(moved, abs=np.sqrt(0.5))

    def test_what_encloses_a_wall_is_asked_for_its_middle_and_a_solid_for_its_outline(self) -> None:
        away = np.sqrt(((np.indices((40, 40, 40)) - 19.5) ** 2).sum(axis=0))
        for inner, kind in ((0, "outline"), (9, "outline"), (13, "wall")):
            mask = (away < 16) & (away >= inner)
            volume = Volume.from_stored(mask.astype(np.uint8), np.eye(4))
            assert outline_followed(mask, volume).what == kind
        assert outline_followed(mask, volume, outlined=True).what == "outline"

    def test_the_middle_of_a_wall_is_no_distance_from_it(self) -> None:
        away = np.sqrt(((np.indices((48, 48, 48)) - 23.5) ** 2).sum(axis=0))
        mask = (away < 21) & (away > 17)
        volume = Volume.from_stored(mask.astype(np.uint8), np.eye(4))
        follows = outline_followed(mask, volume)
        made = {r: follows.apart(reconstruct(balls(*ONE, radius=r), lower=50.0, network="none").mesh) for r in (19, 9)}
        assert np.percentile(made[19].there, 95) == np.percentile(made[19].back, 95) == 0
        assert np.percentile(made[9].there, 95) > 6
        assert np.percentile(made[9].back, 95) > 6


class TestVoxels:
    """Without a network no vertex leaves its cell: whatever the window is, nothing is refused, and nothing told."""

    @law(40)
    @given(
        seed=seeds, shape=st.tuples(*[st.integers(2, 14)] * 3), width=st.sampled_from([0.0, 0.7, 1.5]),
        level=st.floats(-1.0, 1.0), surface=st.sampled_from(["auto", "outer"]), mask=st.booleans(),
    )  # fmt: skip
    def test_no_window_is_refused(
        self, seed: int, shape: tuple[int, int, int], width: float, level: float, surface: str, mask: bool
    ) -> None:
        gray = smooth_noise(seed, shape, width)
        lower = float(gray.mean() + level * gray.std())
        if not (gray > lower).any():
            return
        volume = Volume.from_stored((gray > lower).astype(np.uint8) if mask else gray, np.diag([0.5, 0.7, 3.0, 1]))
        made = reconstruct(volume, lower=0.5 if mask else lower, network="none", surface=surface)
        # even triangles round off the ends of rods a voxel thick: windows of a few voxels may be told of, not refused
        assert followed(made)["far"] is None or (gray > lower).sum() < 20


class TestLimits:
    @pytest.mark.parametrize("grown", [0.5, 0.7, 0.9, 0.95, 1.0, 1.05, 1.1, 1.2, 1.4])
    def test_a_ball_that_is_scaled_is_refused_beyond_what_is_stated(self, grown: float) -> None:
        made, radius = whole(), 9.0
        middle = made.mesh.vertices.mean(axis=0)
        scaled = replace(made, mesh=made.mesh.moved(middle + grown * (made.mesh.vertices - middle)))
        limits, away = LIMITS["voxels"], abs(grown - 1) * radius
        share, offset = max(grown**3, grown**-3), abs(grown**3 - 1) * radius / 4.5

        def beyond(part: float) -> bool:
            """Say so from the volume of a ball over its 6 pi r^2 faces of voxels, which lie its own distance away."""
            return away > part * limits.there or (offset > OFF and share > 1 + part * (limits.volume - 1))

        if beyond(1):
            with pytest.raises(GeometryError, match="does not follow its window") as refused:
                finish(scaled, Settings(), silent)
            assert refused.value.exit_code == 5
            assert "--allow-far" in str(refused.value)
        done, _ = finish(scaled, Settings().replace(allow_far=True), silent)
        told = done.stats["quality"]["follows"]["far"]
        assert (told is not None) == beyond(TOLD)
        assert list(done.warnings) == ([told] if told else [])
        assert ("does not follow" in str(told)) == beyond(1)

    def test_for_few_faces_alone_nothing_is_refused(self) -> None:
        """What is far with the faces that were asked for is told, where with those of its way it is not far."""
        made = whole()
        middle = made.mesh.vertices.mean(axis=0)
        far = replace(made, mesh=made.mesh.moved(middle + 0.6 * (made.mesh.vertices - middle)))
        told = follow(far, Settings(), finer=made)
        assert told.warnings[0].startswith("the mesh with faces so large does not follow its window: ")
        assert told.stats["quality"]["follows"]["far"] == told.warnings[0]
        assert follow(made, Settings(), finer=made).warnings == ()
        with pytest.raises(GeometryError, match="the mesh does not follow its window"):
            follow(far, Settings(), finer=far)

    def test_what_is_a_voxel_thick_may_lose_all_of_its_volume(self) -> None:
        voxels = np.zeros((24, 24, 3), np.uint8)
        voxels[2:22, 2:22, 1] = 1
        made = reconstruct(Volume.from_stored(voxels, np.eye(4)), lower=0.5, network="none")
        thin = made.mesh.vertices * (0.05, 1, 1) + (0.95, 0, 0)
        done, _ = finish(replace(made, mesh=made.mesh.moved(thin)), Settings(), silent)
        found = done.stats["quality"]["follows"]
        assert found["volume_share"] < 0.1
        assert abs(found["offset_voxels"]) < OFF
        assert found["far"] is None

    def test_a_stack_is_held_to_the_volume_between_its_slices(self) -> None:
        angle = np.linspace(0, 2 * np.pi, 60, endpoint=False)
        ring = np.stack([np.cos(angle), np.sin(angle)], axis=1)
        rings = [np.column_stack([(12 - z) * ring, np.full(60, 2.0 * z)]) for z in range(8)]
        made = reconstruct_points(np.concatenate(rings))
        assert (followed(made)["measure"], followed(made)["far"]) == ("slices", None)
        assert made.encloses is not None
        share = followed(made)["volume_share"]
        for times, refused in ((1.24, False), (1.26, True), (1 / 1.24, False), (1 / 1.26, True)):
            other = replace(made, encloses=replace(made.encloses, volume=made.encloses.volume * share / times))
            if refused:
                with pytest.raises(GeometryError, match="does not follow its slices"):
                    finish(other, Settings(), silent)
            else:
                assert "is far from its slices" in finish(other, Settings(), silent)[0].warnings[0]


@pytest.mark.skipif(not COMPILED, reason="networks on many slices, minutes without the compiler")
class TestWays:
    @pytest.mark.parametrize("way", ASKED)
    def test_one_ball_is_written(self, way: str) -> None:
        assert followed(reconstruct(balls(*ONE), lower=50.0, **ASKED[way]))["far"] is None

    @pytest.mark.parametrize("way", ASKED)
    def test_several_are_refused_where_one_network_spans_them(self, way: str) -> None:
        asked, volume = ASKED[way], balls(*(FIVE if way == "sphere" else TWO), radius=6.0)
        if way in ("rings", "sphere"):
            with pytest.raises(GeometryError, match="--way voxels, or --allow-far"):
                reconstruct(volume, lower=50.0, **asked)
            made = reconstruct(volume, lower=50.0, allow_far=True, **asked)
            assert str(followed(made)["far"]).startswith("the mesh does not follow its window")
        else:
            assert followed(reconstruct(volume, lower=50.0, **asked))["far"] is None

    def test_few_faces_are_no_way_around_it(self) -> None:
        for asked in ({"target_faces": 500}, {"edge": 3.0}):
            with pytest.raises(GeometryError, match="--way voxels, or --allow-far"):
                reconstruct(balls(*TWO, radius=6.0), lower=50.0, way="ring", **asked)

    @pytest.mark.parametrize("way", ["rings", "loops", "voxels", "sphere"])
    def test_the_built_in_head_is_written(self, way: str) -> None:
        # half as many rows and columns where every pixel's side is followed
        coarse: dict[str, Any] = (
            {"shape": (54, 128, 128), "spacing_mm": (1.875, 1.875, 2.7)} if way in ("loops", "voxels") else {}
        )
        head = phantom(**coarse)
        asked = ASKED[way] | {"lower": head.lower, "upper": head.upper}
        found = followed(reconstruct(head.volume, **asked))
        assert (found["far"] is None) == (way != "sphere")  # which closes the open end below by itself

    def test_under_paper_the_head_is_written_and_a_ring_inside_of_a_solid_is_not(self) -> None:
        head, paper = phantom(), Settings.for_paper()
        assert followed(reconstruct(head.volume, paper, lower=head.lower, upper=head.upper))["far"] is None
        with pytest.raises(GeometryError, match="follow"):
            reconstruct(balls(*ONE, radius=21.0), paper, lower=50.0)

    @law(6)
    @given(seed=seeds, width=st.sampled_from([2.0, 4.0]))
    def test_no_verdict_depends_on_threads(self, seed: int, width: float) -> None:
        volume = Volume.from_stored(smooth_noise(seed, (8, 28, 28), width), np.eye(4))
        asked: dict[str, Any] = {"lower": 0.0, "neurons": 24, "allow_leaks": True}
        said = []
        for threads in (1, 2, 5):
            try:
                made = reconstruct(volume, threads=threads, **asked)
            except GeometryError as refused:
                said.append(str(refused))
            else:
                said.append(str(made.report["quality"].get("follows")))
        assert len(set(said)) == 1


@pytest.mark.skipif(not COMPILED, reason="networks on many slices, minutes without the compiler")
class TestCommand:
    def test_what_is_far_is_not_written_or_told_in_the_first_line(
        self, tmp_path: Path, capsys: pytest.CaptureFixture[str]
    ) -> None:
        study, mesh = tmp_path / "two.nii", tmp_path / "mesh.ply"
        write_nifti(study, balls(*TWO, radius=6.0).voxels, np.eye(4))
        line = ["reconstruct", str(study), "-o", str(mesh), "--lower", "50", "--way", "ring"]
        assert main(line) == 5
        said = capsys.readouterr().err.splitlines()
        assert [n for n, one in enumerate(said, 1) if one.startswith("error: ")] == [len(said)]
        assert "Try: --way voxels, or --allow-far" in said[-1]
        assert not mesh.exists()
        assert main([*line, "--allow-far"]) == 0
        out = capsys.readouterr().out
        assert out.startswith("far       the mesh does not follow its window: ")
        assert out.count("does not follow") == 1
        assert mesh.exists()
        assert main([*line[:-1], "voxels"]) == 0
        assert capsys.readouterr().out.startswith("study")


@pytest.mark.skipif(not SHARED.exists(), reason="no folder `shared` beside the project")
@pytest.mark.skipif(not COMPILED, reason="real studies, minutes without the compiler")
class TestStudies:
    @pytest.mark.parametrize(
        ("path", "asked"),
        [
            (CT, {"preset": "bone"}),
            (LABELS, {"select": (515, 516)}),
            (LABELS, {"select": (4, 43, 14, 15)}),
            (LABELS, {"select": (2, 41)}),
        ],
    )
    def test_one_ring_is_refused_where_the_voxels_are_followed(self, path: Path, asked: dict[str, Any]) -> None:
        """The way that fits is that of the voxels, and keeps the volume of the window."""
        volume = study_of(path)
        for settings in (Settings(), Settings.for_paper()):
            with pytest.raises(GeometryError, match="follow"):
                reconstruct(volume, settings.replace(way="ring"), **asked)
        made = reconstruct(volume, **asked)
        assert (made.way, followed(made)["far"]) == ("voxels", None)
        assert judged(made).is_watertight
        assert made.segmentation is not None
        window = made.segmentation.mask.sum() * made.segmentation.volume.voxel_mm3
        assert made.mesh.face_volumes.sum() == pytest.approx(window, rel=0.05)

    @pytest.mark.parametrize("faces", [1_000, 5_000, 20_000])
    def test_a_real_head_has_as_few_faces_as_asked_for_or_as_is_named(self, faces: int) -> None:
        try:
            made = reconstruct(study_of(CT), preset="bone", target_faces=faces)
        except GeometryError as refused:
            assert faces < 5_000
            faces = int(str(refused).split("Try: --target-faces ")[1].split(",")[0].rstrip("."))
            made = reconstruct(study_of(CT), preset="bone", target_faces=faces)
        assert len(made.mesh.faces) <= faces
        assert made.report["quality"]["sound"]
        told = followed(made)
        assert 0.8 < told["volume_share"] < 1.25
        near = max(told["mesh_to_window_p95_voxels"], told["window_to_mesh_p95_voxels"]) <= 1
        assert (told["far"] is None) == near

    def test_skin_has_a_ring_a_slice_and_none_inside_of_it(self) -> None:
        volume = study_of(MR)
        assert followed(reconstruct(volume, way="ring"))["far"] is None
        with pytest.raises(GeometryError, match="70% of the volume"):
            reconstruct(volume, Settings.for_paper())
