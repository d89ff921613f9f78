"""Components that are picked by places in them: kept alone, left out, and the same slab by slab."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy import ndimage

from conftest import law, seeds
from slab_studies import MEMORY, blobs, same
from studies import write_nifti
from tomomesh import Volume, read_volume, reconstruct, segment
from tomomesh.cli import main
from tomomesh.errors import EmptyError, UsageError
from tomomesh.isosurface.run_mask import RunMask
from tomomesh.label_surfaces import reconstruct_labels
from tomomesh.large import reconstruct_large
from tomomesh.segmentation.picked import picked
from tomomesh.settings import Settings

if TYPE_CHECKING:
    from pathlib import Path

    from numpy.typing import NDArray

AFFINE = np.array([[0.0, -0.7, 0.1, 5.0], [0.8, 0.0, 0.0, -3.0], [0.0, 0.0, 2.0, 40.0], [0.0, 0.0, 0.0, 1.0]])
"""Turned and sheared."""


def scattered(seed: int) -> NDArray[np.bool_]:
    return np.asarray(np.random.default_rng(seed).random((6, 9, 8)) < 0.12)


def volume_of(mask: NDArray[np.bool_]) -> Volume:
    return Volume.from_stored(mask.astype(np.uint8), AFFINE)


def parts_of(mask: NDArray[np.bool_]) -> tuple[NDArray[Any], int]:
    parts, count = ndimage.label(mask, np.ones((3, 3, 3)))
    return parts, int(count)


def place_in(volume: Volume, part: NDArray[np.bool_], rng: np.random.Generator) -> tuple[float, ...]:
    """Return a place anywhere in any voxel of a component."""
    k, j, i = rng.choice(np.argwhere(part))
    within = np.array([[i, j, k]]) + rng.uniform(-0.49, 0.49, 3)
    return tuple(volume.to_mm(within)[0].tolist())


class TestPicks:
    @law(60)
    @given(seeds, st.data())
    def test_are_whole_components(self, seed: int, data: st.DataObject) -> None:
        """Those that are kept and those that are left out are all, in whatever order and however often given."""
        mask = scattered(seed)
        parts, count = parts_of(mask)
        if count < 2:
            return
        numbers = data.draw(st.lists(st.integers(1, count), min_size=1, max_size=6))
        volume, rng = volume_of(mask), np.random.default_rng(seed)
        places = [place_in(volume, parts == number, rng) for number in numbers]
        runs = RunMask.of([mask])
        kept = picked(runs, volume, keep_at=places)
        np.testing.assert_array_equal(kept.mask[:], np.isin(parts, numbers))
        assert (kept.found, kept.dropped) == (count, count - len(set(numbers)))
        if len(set(numbers)) < count:
            left = picked(runs, volume, drop_at=places[::-1])
            np.testing.assert_array_equal(left.mask[:], mask & ~kept.mask[:])
        if len(set(numbers)) > 1:
            both = picked(runs, volume, keep_at=places, drop_at=places[:1])
            np.testing.assert_array_equal(both.mask[:], kept.mask[:] & (parts != numbers[0]))

    @law(40)
    @given(seeds)
    def test_where_nothing_is_name_the_nearest_voxel(self, seed: int) -> None:
        mask = scattered(seed)
        mask[2, 3, 4] = True
        mask[0, 0, 0] = False
        volume = volume_of(mask)
        place = tuple(volume.to_mm(np.zeros((1, 3)))[0].tolist())
        with pytest.raises(EmptyError, match=r"--drop-at .* mm away") as refused:
            picked(RunMask.of([mask]), volume, drop_at=[place])
        middles = volume.to_mm(np.argwhere(mask)[:, ::-1].astype(np.float64))
        away = np.linalg.norm(middles - place, axis=1)
        assert f"{away.min():.3g} mm away" in str(refused.value)
        named = np.array(str(refused.value).split(" away, is ")[1].rstrip(".").split(), np.float64)
        assert np.linalg.norm(named - place) == pytest.approx(away.min(), rel=1e-4)

    def test_beside_the_study_are_refused(self) -> None:
        with pytest.raises(EmptyError, match="--keep-at 900 0 0"):
            picked(RunMask.of([scattered(0)]), volume_of(scattered(0)), keep_at=[(900, 0, 0)])

    def test_that_leave_nothing_are_refused(self) -> None:
        mask = np.zeros((3, 3, 3), np.bool_)
        mask[1, 1, 1] = True
        volume = volume_of(mask)
        with pytest.raises(EmptyError, match="no component is left"):
            picked(RunMask.of([mask]), volume, drop_at=[tuple(volume.to_mm(np.ones((1, 3)))[0])])


def two_balls() -> tuple[Volume, list[list[float]]]:
    """Return two balls, and their middles."""
    k, j, i = np.mgrid[:16, :20, :40]
    levels = np.zeros((16, 20, 40), np.int16)
    middles = [(8, 10, 9), (8, 10, 28)]
    for number, (c, b, a) in enumerate(middles):
        levels[(k - c) ** 2 + (j - b) ** 2 + (i - a) ** 2 <= (7 - number) ** 2] = 100
    study = Volume.from_stored(levels, np.diag([1.0, 1.0, 1.5, 1.0]))
    return study, study.to_mm(np.array(middles, np.float64)[:, ::-1]).tolist()


class TestRuns:
    @pytest.mark.parametrize("way", ["ring", "contours", "voxels"])
    def test_on_every_way(self, way: str) -> None:
        study, (large, small) = two_balls()
        found = [
            reconstruct(study, lower=50, way=way, **picks).mesh
            for picks in ({"drop_at": [small]}, {"keep_at": [large]}, {"keep": "largest"})
        ]
        assert len({(mesh.vertices.tobytes(), mesh.faces.tobytes()) for mesh in found}) == 1

    def test_the_report_counts_them(self) -> None:
        study, (_, small) = two_balls()
        whole, left = (segment(study, lower=50, network="none", drop_at=at) for at in (None, [small]))
        assert [found.report["window"]["left_out_components"] for found in (whole, left)] == [0, 1]
        voxels = left.report["window"]["left_out_voxels"]
        assert voxels == whole.mask.sum() - left.mask.sum() > 0

    @law(12)
    @given(seeds, st.integers(1, 9))
    def test_slab_by_slab_the_bytes_are_the_same(self, seed: int, slab: int) -> None:
        levels = blobs(seed)
        study = Volume.from_stored(levels, np.diag([0.7, 0.8, 0.9, 1.0]))
        parts, count = parts_of(levels > 60)
        if count < 2:
            return
        largest = 1 + int(np.argmax(np.bincount(parts.ravel())[1:]))
        place = place_in(study, parts == largest, np.random.default_rng(seed))
        asked: dict[str, Any] = {"lower": 60, "way": "voxels", "keep": "all", "keep_at": [place], **MEMORY}
        assert same(reconstruct_large(study, slab=slab, **asked), reconstruct(study, **asked))

    def test_labels_too(self) -> None:
        study, (_, small) = two_balls()
        labels = Volume.from_stored((study.voxels > 0).astype(np.uint8), study.affine)
        found = segment(labels, select=(1,), network="none", keep_at=small)
        assert parts_of(found.mask)[1] == 1
        assert 0 < found.mask.sum() < (study.voxels > 0).sum() / 2

    def test_a_surface_a_label_is_refused(self) -> None:
        study, (_, small) = two_balls()
        with pytest.raises(UsageError, match="--select"):
            reconstruct_labels(Volume.from_stored((study.voxels > 0).astype(np.uint8), study.affine), keep_at=[small])


class TestCommandLine:
    def test_places_are_given_again_and_again(self, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
        study, (large, small) = two_balls()
        path = write_nifti(tmp_path / "balls.nii", np.asarray(study.voxels), study.affine)
        middles = read_volume(path).to_mm(read_volume(path).to_indices(np.array([large, small])))
        words = [[f"{side:g}" for side in middle] for middle in middles]
        both = ["--keep-at", *words[0], f"--keep-at={','.join(words[1])}", "--drop-at", *words[0]]
        common = ["reconstruct", str(path), "--lower", "50", "--quiet"]
        assert main([*common, "-o", str(tmp_path / "a.ply"), *both, "--save-settings", str(tmp_path / "a.toml")]) == 0
        assert main([*common, "-o", str(tmp_path / "b.ply"), "--keep-at", *words[1]]) == 0
        assert (tmp_path / "a.ply").read_bytes() == (tmp_path / "b.ply").read_bytes()
        again = ["reconstruct", str(path), "--settings", str(tmp_path / "a.toml"), "-o", str(tmp_path / "c.ply")]
        assert main([*again, "--quiet"]) == 0
        assert (tmp_path / "c.ply").read_bytes() == (tmp_path / "a.ply").read_bytes()
        capsys.readouterr()
        assert main([*common, "-o", str(tmp_path / "d.ply"), "--drop-at", "900", "0", "0"]) == 6
        assert capsys.readouterr().err.count("\n") == 1

    def test_words_repeat_the_settings(self) -> None:
        settings = Settings().replace(drop_at=[(1, -2.5, 1e-3), (4, 5, 6)])
        assert settings.words() == ["--drop-at", "1", "-2.5", "0.001", "--drop-at", "4", "5", "6"]
        assert settings.window.drop_at == ((1, -2.5, 1e-3), (4, 5, 6))
