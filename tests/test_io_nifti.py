"""NIfTI: millimeters, axis orders, headers that lie, and labels on the study's own grid."""

from __future__ import annotations

import gzip
import itertools
from typing import TYPE_CHECKING, Any

import nibabel
import numpy as np
import pytest
from nibabel.orientations import inv_ornt_aff

from studies import AFFINES, LPS_TO_RAS, SHAPE, assert_in_place, indices_of, sampled, shared, write_nifti
from tomomesh.errors import FormatError, GeometryError, OutputError, ResourceError, TomomeshError, UsageError
from tomomesh.io import read_volume, write_labels
from tomomesh.io.files import limits, unpack
from tomomesh.settings import ReadSettings

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

    from numpy.typing import NDArray

ORDERS = [
    np.array(list(zip(axes, signs, strict=True)), np.float64)
    for axes in itertools.permutations(range(3))
    for signs in itertools.product((1, -1), repeat=3)
]


def write_reordered(path: Path, order: NDArray[np.float64], name: str = "oblique") -> Any:
    """Write the study with its axes permuted and flipped by nibabel, millimeters unchanged."""
    image = nibabel.Nifti1Image(sampled(AFFINES[name]).T, LPS_TO_RAS @ AFFINES[name])
    affine = image.affine @ inv_ornt_aff(order, image.shape)
    turned = nibabel.Nifti1Image(nibabel.orientations.apply_orientation(np.asarray(image.dataobj), order), affine)
    nibabel.save(turned, path)
    return turned


class TestMillimeters:
    @pytest.mark.parametrize("name", AFFINES)
    @pytest.mark.parametrize("suffix", [".nii", ".nii.gz"])
    def test_every_voxel_is_where_its_gray_level_says(self, tmp_path: Path, name: str, suffix: str) -> None:
        path = tmp_path / f"study{suffix}"
        nibabel.save(nibabel.Nifti1Image(sampled(AFFINES[name]).T, LPS_TO_RAS @ AFFINES[name]), path)
        volume = read_volume(path)
        assert_in_place(volume)
        assert volume.unit == "stored"
        assert volume.voxels.dtype == np.int16

    def test_all_axis_orders_give_the_same_canonical_array(self, tmp_path: Path) -> None:
        reference = read_volume(write_nifti(tmp_path / "a.nii", sampled(AFFINES["oblique"]), AFFINES["oblique"]))
        for order in ORDERS:
            write_reordered(tmp_path / "b.nii", order)
            volume = read_volume(tmp_path / "b.nii")
            np.testing.assert_array_equal(volume.voxels, reference.voxels)
            np.testing.assert_allclose(volume.affine, reference.affine, atol=1e-5)

    def test_qform_is_used_where_there_is_no_sform(self, tmp_path: Path) -> None:
        image = nibabel.Nifti1Image(sampled(AFFINES["oblique"]).T, None)
        image.header.set_qform(LPS_TO_RAS @ AFFINES["oblique"], code=1)
        nibabel.save(image, tmp_path / "q.nii")
        assert_in_place(read_volume(tmp_path / "q.nii"))

    @pytest.mark.parametrize(("code", "mm"), [(1, 1000.0), (3, 0.001), (2, 1.0), (0, 1.0)])
    def test_meters_and_microns_become_millimeters(self, tmp_path: Path, code: int, mm: float) -> None:
        affine = AFFINES["axial"].copy()
        affine[:3] /= mm

        def edit(header: Any) -> None:
            header["xyzt_units"] = code

        volume = read_volume(write_nifti(tmp_path / "u.nii", sampled(AFFINES["axial"]), affine, edit))
        assert_in_place(volume, 0.6)
        assert len(volume.notes) == (mm != 1)

    def test_both_byte_orders_and_nifti_2_give_the_same(self, tmp_path: Path) -> None:
        stored, affine = sampled(AFFINES["axial"]), LPS_TO_RAS @ AFFINES["axial"]
        big = nibabel.Nifti1Image(stored.T, affine, nibabel.Nifti1Header(endianness=">"))
        nibabel.save(big, tmp_path / "big.nii")
        nibabel.save(nibabel.Nifti2Image(stored.T, affine), tmp_path / "two.nii")
        for name in ("big.nii", "two.nii"):
            volume = read_volume(tmp_path / name)
            assert_in_place(volume)
            assert volume.voxels.dtype.isnative

    @pytest.mark.parametrize("kind", ["i1", "u1", "i2", "u2", "i4", "u4", "i8", "f4", "f8"])
    def test_every_kind_of_number_equals_nibabel(self, tmp_path: Path, kind: str) -> None:
        stored = (np.arange(np.prod(SHAPE)) % 100).astype(kind).reshape(SHAPE)
        image = nibabel.Nifti1Image(stored.T, LPS_TO_RAS @ AFFINES["axial"], dtype=stored.dtype)
        image.header.set_slope_inter(2.5, -7)
        nibabel.save(image, tmp_path / "k.nii")
        read = np.asarray(nibabel.load(tmp_path / "k.nii").dataobj).T
        np.testing.assert_allclose(read_volume(tmp_path / "k.nii").voxels, read, rtol=1e-6)

    def test_an_integral_scale_keeps_integers(self, tmp_path: Path) -> None:
        def edit(header: Any) -> None:
            header["scl_slope"], header["scl_inter"] = 1, -1024

        volume = read_volume(write_nifti(tmp_path / "s.nii", np.full(SHAPE, 200, np.uint8), AFFINES["axial"], edit))
        assert volume.voxels.dtype == np.int16
        assert (volume.voxels == -824).all()

    def test_color_has_three_channels(self, tmp_path: Path) -> None:
        colors = np.zeros(SHAPE, [("R", "u1"), ("G", "u1"), ("B", "u1")])
        colors["R"], colors["G"], colors["B"] = 10, 20, np.arange(9)
        nibabel.save(nibabel.Nifti1Image(colors.T, LPS_TO_RAS @ AFFINES["axial"]), tmp_path / "c.nii")
        voxels = read_volume(tmp_path / "c.nii").voxels
        assert voxels.shape == (*SHAPE, 3)
        np.testing.assert_array_equal(voxels[0, 0], [[10, 20, b] for b in range(9)])

    @pytest.mark.parametrize(("suffix", "named"), [(".nii", ".nii.gz"), (".nii.gz", ".nii")])
    def test_whether_it_is_packed_is_seen_in_its_bytes(self, tmp_path: Path, suffix: str, named: str) -> None:
        write_nifti(tmp_path / f"s{suffix}", sampled(AFFINES["oblique"]), AFFINES["oblique"])
        assert_in_place(read_volume((tmp_path / f"s{suffix}").rename(tmp_path / f"t{named}")))

    def test_vectors_are_told_from_frames(self, tmp_path: Path) -> None:
        stored = np.zeros((4, 5, 6, 1, 3), np.float32)
        nibabel.save(nibabel.Nifti1Image(stored, np.eye(4)), tmp_path / "s.nii")
        with pytest.raises(FormatError, match="several values a voxel"):
            read_volume(tmp_path / "s.nii")

    def test_one_frame_in_four_dimensions_is_squeezed(self, tmp_path: Path) -> None:
        stored = sampled(AFFINES["axial"]).T[..., None]
        nibabel.save(nibabel.Nifti1Image(stored, LPS_TO_RAS @ AFFINES["axial"]), tmp_path / "4.nii")
        assert_in_place(read_volume(tmp_path / "4.nii"))


def field(name: str, value: Any, index: int | None = None) -> Callable[[Any], None]:
    def edit(header: Any) -> None:
        if index is None:
            header[name] = value
        else:
            header[name][index] = value

    return edit


def no_forms(header: Any) -> None:
    header["sform_code"] = header["qform_code"] = 0


def flat(header: Any) -> None:
    header["srow_z"] = header["srow_y"]


FAULTS = {
    "spacing 0": (field("pixdim", 0, 2), GeometryError, "pixdim[2] = 0"),
    "spacing negative": (field("pixdim", -1, 1), GeometryError, "pixdim[1] = -1"),
    "spacing NaN": (field("pixdim", np.nan, 3), GeometryError, "pixdim[3] = nan"),
    "spacing infinite": (field("pixdim", np.inf, 3), GeometryError, "pixdim[3] = inf"),
    "spacing 1e-30": (field("pixdim", 1e-30, 3), GeometryError, "pixdim[3] = 1e-30"),
    "singular": (flat, GeometryError, "singular"),
    "affine NaN": (field("srow_x", np.nan, 1), GeometryError, "singular"),
    "unit": (field("xyzt_units", 5), GeometryError, "xyzt_units = 5"),
    "intercept NaN": (field("scl_inter", np.nan), FormatError, "intercept = nan"),
    "size 0": (field("dim", 0, 1), FormatError, "dim = [3, 0"),
    "size negative": (field("dim", -4, 2), FormatError, "dim"),
    "no dimensions": (field("dim", 0, 0), FormatError, "dim"),
    "data type": (field("datatype", 9999), FormatError, "datatype = 9999"),
    "complex": (field("datatype", 32), FormatError, "complex64"),
    "offset": (field("vox_offset", 17), FormatError, "vox_offset = 17"),
    "too long": (field("dim", 6, 3), FormatError, "cut off"),
    "no magic": (field("magic", b"ni1"), FormatError, "no NIfTI"),
    "bomb": (field("dim", [3, 32767, 32767, 32767, 1, 1, 1, 1]), ResourceError, "memory"),
}


class TestFaults:
    @pytest.mark.parametrize("fault", FAULTS)
    def test_a_header_that_lies_is_refused(self, tmp_path: Path, fault: str) -> None:
        edit, error, word = FAULTS[fault]
        path = write_nifti(
            tmp_path / "f.nii",
            sampled(AFFINES["axial"]).astype("c8" if fault == "complex" else "i2"),
            AFFINES["axial"],
            edit,
        )
        with pytest.raises(error) as caught:
            read_volume(path)
        assert word in str(caught.value)
        assert "f.nii" in str(caught.value)

    @pytest.mark.parametrize("edit", [FAULTS["spacing 0"][0], FAULTS["spacing NaN"][0], no_forms])
    def test_a_given_spacing_stands_in_for_a_missing_frame(self, tmp_path: Path, edit: Callable[[Any], None]) -> None:
        path = write_nifti(tmp_path / "f.nii", sampled(AFFINES["axial"]), AFFINES["axial"], edit)
        volume = read_volume(path, settings=ReadSettings(spacing=(0.5, 0.7, 2)))
        np.testing.assert_array_equal(volume.affine, np.diag([0.5, 0.7, 2, 1]))
        assert "--spacing" in volume.notes[0]

    def test_a_spacing_that_is_not_needed_is_not_used(self, tmp_path: Path) -> None:
        path = write_nifti(tmp_path / "f.nii", sampled(AFFINES["axial"]), AFFINES["axial"])
        volume = read_volume(path, settings=ReadSettings(spacing=(9, 9, 9)))
        assert_in_place(volume)
        assert "not used" in volume.notes[0]

    def test_several_frames_are_refused(self, tmp_path: Path) -> None:
        nibabel.save(nibabel.Nifti1Image(np.zeros((3, 4, 5, 2), np.int16), np.eye(4)), tmp_path / "t.nii")
        with pytest.raises(FormatError, match="several frames"):
            read_volume(tmp_path / "t.nii")

    @pytest.mark.parametrize("kept", [0, 10, 200, 400, -20])
    def test_a_file_that_is_cut_off_is_refused(self, tmp_path: Path, kept: int) -> None:
        path = write_nifti(tmp_path / "f.nii", sampled(AFFINES["axial"]), AFFINES["axial"])
        whole = path.read_bytes()
        path.write_bytes(whole[:kept])
        (tmp_path / "f.nii.gz").write_bytes(gzip.compress(whole)[: kept if kept < 0 else kept // 2])
        for name in ("f.nii", "f.nii.gz"):
            with pytest.raises(FormatError):
                read_volume(tmp_path / name)

    def test_a_damaged_check_sum_is_noticed(self, tmp_path: Path) -> None:
        path = write_nifti(tmp_path / "f.nii", sampled(AFFINES["axial"]), AFFINES["axial"])
        packed = bytearray(gzip.compress(path.read_bytes()))
        packed[-8] ^= 1
        (tmp_path / "f.nii.gz").write_bytes(packed)
        with pytest.raises(FormatError, match="gzip"):
            read_volume(tmp_path / "f.nii.gz")

    def test_text_with_the_suffix_of_nifti_is_refused(self, tmp_path: Path) -> None:
        (tmp_path / "t.nii").write_text("no volume " * 100)
        with pytest.raises(FormatError, match="no NIfTI"):
            read_volume(tmp_path / "t.nii")

    def test_a_stream_that_goes_on_after_its_voxels_is_stopped(
        self, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        path = write_nifti(tmp_path / "f.nii", sampled(AFFINES["axial"]), AFFINES["axial"])
        (tmp_path / "f.nii.gz").write_bytes(gzip.compress(path.read_bytes() + bytes(2**22)))
        assert_in_place(read_volume(tmp_path / "f.nii.gz"))
        monkeypatch.setattr(unpack, "SURPLUS_BYTES", 2**20)
        with pytest.raises(ResourceError):
            read_volume(tmp_path / "f.nii.gz")

    def test_voxels_beyond_the_memory_are_refused(self, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
        path = write_nifti(tmp_path / "f.nii", sampled(AFFINES["axial"]), AFFINES["axial"])
        monkeypatch.setattr(limits, "physical_memory", lambda: 100)
        with pytest.raises(ResourceError, match="at most 100 bytes"):
            read_volume(path)


class TestHoles:
    def test_nan_and_infinite_voxels_become_background(self, tmp_path: Path) -> None:
        stored = sampled(AFFINES["axial"]).astype(np.float32)
        lowest = stored.min()
        stored[0, 0, :3] = [np.nan, np.inf, -np.inf]
        volume = read_volume(write_nifti(tmp_path / "h.nii", stored, AFFINES["axial"]))
        np.testing.assert_array_equal(volume.voxels[0, 0, :3], lowest)
        assert volume.notes == ("NaN or infinite voxels set to the background: 3",)

    @pytest.mark.parametrize("part", [2, 1])
    def test_over_half_is_refused(self, tmp_path: Path, part: int) -> None:
        stored = np.full(SHAPE, np.nan, np.float32)
        stored.reshape(-1)[: stored.size * (part - 1) // 3] = 1
        with pytest.raises(GeometryError, match="more than half"):
            read_volume(write_nifti(tmp_path / "h.nii", stored, AFFINES["axial"]))


class TestLabels:
    @pytest.mark.parametrize("suffix", [".nii", ".nii.gz"])
    def test_labels_lie_on_the_grid_of_the_file_for_all_axis_orders(self, tmp_path: Path, suffix: str) -> None:
        for order in ORDERS:
            source = write_reordered(tmp_path / "s.nii", order)
            volume = read_volume(tmp_path / "s.nii")
            write_labels(volume.voxels.astype(np.uint16), volume, tmp_path / f"l{suffix}")
            labels = nibabel.load(tmp_path / f"l{suffix}")
            np.testing.assert_array_equal(np.asarray(labels.dataobj), np.asarray(source.dataobj))
            np.testing.assert_array_equal(labels.affine, nibabel.load(tmp_path / "s.nii").affine)
            assert labels.get_data_dtype() == np.uint16
            assert labels.header.get_xyzt_units()[0] == "mm"

    def test_labels_of_a_turned_view_lie_on_the_same_grid(self, tmp_path: Path) -> None:
        path = write_nifti(tmp_path / "s.nii", sampled(AFFINES["oblique"]), AFFINES["oblique"])
        for axis in range(3):
            turned = read_volume(path).along(axis)
            write_labels(turned.voxels.astype(np.uint16), turned, tmp_path / "l.nii")
            labels = np.asarray(nibabel.load(tmp_path / "l.nii").dataobj)
            np.testing.assert_array_equal(labels, np.asarray(nibabel.load(path).dataobj))

    def test_the_bytes_repeat(self, tmp_path: Path) -> None:
        volume = read_volume(write_nifti(tmp_path / "s.nii", sampled(AFFINES["axial"]), AFFINES["axial"]))
        for name in ("a.nii.gz", "b.nii.gz"):
            write_labels(volume.voxels.astype(np.uint16), volume, tmp_path / name)
        first = (tmp_path / "a.nii.gz").read_bytes()
        assert first == (tmp_path / "b.nii.gz").read_bytes()
        assert first[3:8] == bytes(5)  # no name, no time

    def test_sides_that_nifti_cannot_hold_are_refused(self, tmp_path: Path) -> None:
        nibabel.save(nibabel.Nifti2Image(np.zeros((32768, 1, 1), np.int8), np.eye(4)), tmp_path / "s.nii")
        volume = read_volume(tmp_path / "s.nii")
        with pytest.raises(OutputError, match="32767"):
            write_labels(np.zeros((1, 1, 32768), np.uint16), volume, tmp_path / "l.nii")
        with pytest.raises(UsageError):
            write_labels(np.zeros((1, 1, 2), np.uint16), volume, tmp_path / "l.stl")
        assert [path.name for path in tmp_path.iterdir()] == ["s.nii"]


class TestSharedData:
    def test_one_brain_in_all_its_axis_orders_is_one_array(self) -> None:
        paths = sorted(shared("niivue/nifti_space").glob("*.nii.gz"))
        assert len(paths) == 8
        reference = read_volume(paths[0])
        for path in paths[1:]:
            volume = read_volume(path)
            np.testing.assert_array_equal(volume.voxels, reference.voxels)
            np.testing.assert_allclose(volume.affine, reference.affine, atol=1e-3)

    @pytest.mark.parametrize(
        "name",
        [
            "dicom2stl/ct_example.nii.gz",
            "volrender/seg3D/MR.nii.gz",
            "totalsegmentator/example_seg_dicom.nii.gz",
        ],
    )
    def test_voxels_and_millimeters_equal_nibabel(self, name: str) -> None:
        volume, image = read_volume(shared(name)), nibabel.load(shared(name))
        closest = nibabel.as_closest_canonical(image)
        expected = np.asarray(closest.dataobj)[::-1, ::-1].T
        np.testing.assert_allclose(volume.voxels, expected, rtol=1e-6)
        corner = indices_of(volume.shape)[-1:]
        np.testing.assert_allclose(
            (volume.to_mm(corner) * [-1, -1, 1])[0],
            (closest.affine @ [0, 0, volume.shape[0] - 1, 1])[:3],
            atol=1e-3,
        )

    @pytest.mark.parametrize(
        ("name", "error"),
        [
            ("truncated_data.nii", FormatError),
            ("bad_datatype.nii.gz", FormatError),
            ("dim_huge_bomb.nii.gz", ResourceError),
            ("pixdim_zero.nii.gz", GeometryError),
            ("dim_zero.nii.gz", FormatError),
            ("empty.nii.gz", FormatError),
            ("corrupt_gzip_crc.nii.gz", FormatError),
            ("missing_raw.mhd", FormatError),
            ("truncated.mha", FormatError),
            ("sizes_mismatch.nrrd", FormatError),
        ],
    )
    def test_malformed_files_are_refused(self, name: str, error: type[TomomeshError]) -> None:
        with pytest.raises(error):
            read_volume(shared("malformed") / name)
