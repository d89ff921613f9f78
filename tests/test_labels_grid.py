"""Labels laid onto a study's grid: every label stays where it was in the patient."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from conftest import law, seeds
from faults import fault_of
from segmentations import written
from studies import AFFINES, affine_of, rotation, write_nifti, write_series
from test_cli import fails
from tomomesh.cli import main
from tomomesh.errors import GeometryError, UsageError
from tomomesh.model.volume import Volume
from tomomesh.segmentation.grid import onto_grid
from tomomesh.segmentation.labels import labels_in, whole

if TYPE_CHECKING:
    from pathlib import Path

    from _pytest.capture import CaptureFixture
    from numpy.typing import NDArray

STUDY = (6, 7, 8)
offsets = st.tuples(*[st.integers(-4, 6)] * 3)
sizes = st.tuples(*[st.integers(1, 8)] * 3)


def volume(voxels: NDArray[np.int64], affine: NDArray[np.float64]) -> Volume:
    return Volume.from_stored(voxels, affine)


def places(labels: Volume) -> dict[tuple[float, ...], int]:
    """Return the label at every place in the patient that has one."""
    indices = np.argwhere(labels.voxels)
    mm = np.round(labels.to_mm(indices[:, ::-1].astype(float)), 4) + 0.0
    return dict(zip(map(tuple, mm.tolist()), labels.voxels[labels.voxels > 0].tolist(), strict=True))


@law(60)
@given(seeds, sizes, offsets, st.sampled_from(sorted(AFFINES)), st.permutations([0, 1, 2]), st.integers(0, 7))
def test_labels_stay_in_their_place(
    seed: int, shape: tuple[int, int, int], offset: tuple[int, int, int], place: str, order: list[int], flips: int
) -> None:
    study = volume(np.zeros(STUDY, np.int64), AFFINES[place])
    found = np.random.default_rng(seed).integers(0, 4, shape)
    steps = np.eye(4)
    steps[:3, :3] = np.eye(3)[order] * [1 - 2 * (flips >> n & 1) for n in range(3)]
    steps[:3, 3] = offset
    labels = volume(found, AFFINES[place] @ steps)
    corner = study.to_mm(np.argwhere(np.ones(study.shape))[:, ::-1].astype(float))
    inside = set(map(tuple, (np.round(corner, 4) + 0.0).tolist()))
    if fault := fault_of(onto_grid, labels, study):
        assert "outside" in str(fault)
        assert not inside & set(places(labels))
        return
    laid = onto_grid(labels, study)
    assert laid.shape == study.shape
    np.testing.assert_array_equal(laid.affine, study.affine)
    expected = {spot: label for spot, label in places(labels).items() if spot in inside}
    assert places(laid) == expected
    lost = len(places(labels)) - len(expected)
    assert any(f"left out: {lost}" in note for note in laid.notes) == (lost > 0)


def test_the_same_grid_is_left_as_it_is() -> None:
    study = volume(np.zeros(STUDY, np.int64), AFFINES["oblique"])
    labels = volume(np.ones(STUDY, np.int64), AFFINES["oblique"])
    assert onto_grid(labels, study) is labels


@pytest.mark.parametrize(
    ("affine", "said"),
    [
        (affine_of(np.eye(3), spacing=(0.5, 0.7, 4.0)), "do not fit"),
        (affine_of(np.eye(3), spacing=(0.51, 0.7, 2.0)), "do not fit"),
        (affine_of(rotation(0.03, 0, 0)), "do not fit"),
        (affine_of(np.eye(3), origin=(-3.2, 11.0, 40.0)), "0.2 mm off its voxels, 0.4 of one"),
        (affine_of(np.eye(3), origin=(-3.0, 11.0, 40.3)), "0.3 mm off its voxels, 0.15 of one"),
        (affine_of(np.eye(3), origin=(-3.0, 11.0, 60.0)), "outside"),
    ],
)
def test_other_grids_are_refused(affine: NDArray[np.float64], said: str) -> None:
    study = volume(np.zeros(STUDY, np.int64), AFFINES["axial"])
    with pytest.raises(GeometryError, match=said):
        onto_grid(volume(np.ones(STUDY, np.int64), affine), study)


@law(60)
@given(seeds, st.floats(-2, 2), st.sampled_from(sorted(AFFINES)))
def test_grids_that_nearly_agree_are_taken_below_a_tenth_of_a_voxel(seed: int, power: float, place: str) -> None:
    rng, size = np.random.default_rng(seed), 0.1 * 10**power
    corners = np.array(list(np.ndindex(2, 2, 2))) * (np.array(STUDY[::-1]) - 1)
    beside = rng.standard_normal((3, 4))
    beside *= size / np.linalg.norm(corners @ beside[:, :3].T + beside[:, 3], axis=1).max()
    assume(min(abs(size - 0.1), abs(size - 0.01)) > 1e-6)
    study = volume(np.zeros(STUDY, np.int64), AFFINES[place])
    found = rng.integers(0, 4, STUDY)
    labels = volume(found, AFFINES[place] @ (np.eye(4) + np.vstack([beside, np.zeros(4)])))
    assume(labels.grid.axes == study.grid.axes and labels.grid.flipped == study.grid.flipped)
    fault = fault_of(onto_grid, labels, study)
    if fault:
        assert size > 0.1 / 2  # a corner may be nearer to another voxel, never farther than from its own
        return
    assert size < 0.1 or (np.abs(beside) > 0.4).any()
    if size < 0.1:
        laid = onto_grid(labels, study)
        np.testing.assert_array_equal(study.grid.restore(laid.voxels), found)
        assert (f"{size:.2g} voxels beside" in " ".join(laid.notes)) == (size > 0.01)


@pytest.mark.parametrize("spacing", [0.9766, 0.97657, 0.977, 0.9766004])
def test_a_difference_is_shown_in_the_digits_that_differ(spacing: float) -> None:
    shape = (2, 2000, 2000)
    study = volume(np.zeros(shape, np.uint8), affine_of(np.eye(3), spacing=(0.9765625, 0.9765625, 3.0)))
    labels = volume(np.zeros(shape, np.uint8), affine_of(np.eye(3), spacing=(spacing, spacing, 3.0)))
    fault = fault_of(onto_grid, labels, study)
    if 1999 * (spacing - 0.9765625) / 0.9765625 * 2**0.5 < 0.1:
        assert not fault
        return
    said = str(fault)
    first, second = (re.search(rf"{word}: \[?[^.]*voxels of (\S+)", said) for word in ("Found", "Expected"))
    assert first
    assert second
    assert first[1] != second[1]


class TestWhole:
    """Labels that are nearly whole, as other programs' interpolation leaves them."""

    @pytest.mark.parametrize("kind", [np.float32, np.float64])
    @pytest.mark.parametrize("off", [0.0, 0.0000458, -0.0009])
    def test_below_a_thousandth_they_are_rounded(self, kind: Any, off: float) -> None:
        found = np.arange(STUDY[0] * STUDY[1] * STUDY[2]).reshape(STUDY) % 4
        labels = whole(volume((found + off * (found == 3)).astype(kind), AFFINES["oblique"]))
        np.testing.assert_array_equal(labels.voxels, volume(found, AFFINES["oblique"]).voxels)
        assert any("nearly whole" in note for note in labels.notes) == (off != 0)
        assert labels_in(labels.voxels + off) == labels_in(labels.voxels)

    @pytest.mark.parametrize(("label", "shown"), [(3.002, "3.002"), (2.5, "2.5"), (np.inf, "inf"), (np.nan, "nan")])
    def test_others_are_shown(self, label: float, shown: str) -> None:
        found = np.zeros(STUDY)
        found[1, 2, 3] = label
        with pytest.raises(UsageError, match=shown):
            whole(volume(found, AFFINES["axial"]))

    def test_the_command_line_tells(self, tmp_path: Path, capsys: CaptureFixture[str]) -> None:
        ball = np.linalg.norm(np.indices((16, 16, 16)) - 7.5, axis=0) < 5
        write_nifti(tmp_path / "l.nii", (3.0000458 * ball).astype(np.float32), AFFINES["axial"])
        assert main(["reconstruct", str(tmp_path / "l.nii"), "--select", "3", "-o", str(tmp_path / "m.ply")]) == 0
        assert "nearly whole" in capsys.readouterr().out


class TestCommandLine:
    @pytest.fixture
    def files(self, tmp_path: Path) -> dict[str, str]:
        """A ball in a study; its labels as a segmentation without the empty slices, and as a part of the grid."""
        affine, shape = AFFINES["oblique"], (14, 40, 52)
        k, j, i = (np.arange(n) - (n - 1) / 2 for n in shape)
        ball = (2 * k[:, None, None]) ** 2 + (0.7 * j[None, :, None]) ** 2 + (0.5 * i) ** 2 < 11**2
        write_series(tmp_path / "study", 100 * ball.astype(np.int16), affine)
        written({1: ~ball, 2: ball}, affine, tmp_path / "seg.dcm")
        cut = affine.copy()
        cut[:3, 3] += affine[:3, :3] @ (1, 2, 1)
        write_nifti(tmp_path / "part.nii", 2 * ball[1:, 2:, 1:].astype(np.int16), cut)
        write_nifti(tmp_path / "elsewhere.nii", 2 * ball.astype(np.int16), AFFINES["axial"])
        return {name: str(tmp_path / name) for name in ("study", "seg.dcm", "part.nii", "elsewhere.nii")}

    def test_every_kind_of_labels_gives_the_mesh_of_the_window(self, files: dict[str, str], tmp_path: Path) -> None:
        mesh = {name: tmp_path / f"{n}.ply" for n, name in enumerate(("window", *files))}
        common = ["--quiet", "--contours", "loops", "--neurons", "60"]
        assert main(["reconstruct", files["study"], "--lower", "50", "-o", str(mesh["window"]), *common]) == 0
        for name in ("seg.dcm", "part.nii"):
            line = ["reconstruct", files["study"], "--labels-in", files[name], "--select", "2"]
            assert main([*line, "-o", str(mesh[name]), *common]) == 0
            assert mesh[name].read_bytes() == mesh["window"].read_bytes()

    def test_a_segmentation_is_a_study(self, files: dict[str, str], tmp_path: Path) -> None:
        one, two = tmp_path / "one.ply", tmp_path / "two.ply"
        line = ["reconstruct", "--select", "2", "--quiet", "--contours", "loops"]
        assert main([*line, "--labels-in", files["seg.dcm"], "-o", str(one)]) == 0
        assert main([*line, files["seg.dcm"], "-o", str(two)]) == 0
        assert one.read_bytes() == two.read_bytes()

    def test_the_report_tells_what_was_decided(
        self, files: dict[str, str], tmp_path: Path, capsys: CaptureFixture[str]
    ) -> None:
        line = ["segment", files["study"], "--labels-in", files["part.nii"], "--select", "2"]
        assert main([*line, "-o", str(tmp_path / "p.ply")]) == 0
        assert "the labels cover 51 x 38 x 13 of the study's 52 x 40 x 14 voxels" in capsys.readouterr().out

    def test_labels_of_another_study_are_refused(
        self, files: dict[str, str], tmp_path: Path, capsys: CaptureFixture[str]
    ) -> None:
        line = ["reconstruct", files["study"], "-o", str(tmp_path / "m.ply"), "--select", "2", "--labels-in"]
        assert "do not fit the study" in fails([*line, files["elsewhere.nii"]], 5, capsys)
        assert not (tmp_path / "m.ply").exists()
