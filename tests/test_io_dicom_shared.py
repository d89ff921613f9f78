"""The public DICOM studies: read or refused as they should be."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy import ndimage

from studies import shared
from tomomesh.errors import FormatError, GeometryError
from tomomesh.io import read_volume
from tomomesh.measure.report import compare
from tomomesh.pipeline import reconstruct
from tomomesh.settings import ReadSettings

ARM = 69
"""The label of the upper arm."""


class TestSharedData:
    @pytest.mark.parametrize(
        ("name", "shape"),
        [
            ("dicom2nifti/siemens", (256, 256, 4)),
            ("dicom2nifti/philips", (240, 4, 240)),
            ("dicom2nifti/philips_enhanced", (256, 256, 8)),
            ("dicom2nifti/generic/rgb", (4, 77, 52)),
            ("dicom2nifti/generic/compressed_rle", (256, 256, 4)),
            ("dicom2nifti/generic/anatomical/002_non_isotropic", (4, 28, 64)),
            ("niivue/demos/images/enh.dcm", (6, 64, 64)),
        ],
    )
    def test_series_of_several_vendors_are_read(self, name: str, shape: tuple[int, int, int]) -> None:
        assert read_volume(shared(name)).shape == shape

    def test_compressed_slices_lie_where_plain_ones_do(self) -> None:
        plain = read_volume(shared("dicom2nifti/generic/anatomical/001"))
        packed = read_volume(shared("dicom2nifti/generic/compressed_rle"))
        np.testing.assert_array_equal(plain.affine, packed.affine)

    def test_a_body_lies_where_its_labels_do(self) -> None:
        body = read_volume(shared("totalsegmentator/example_ct_dicom"))
        labels = read_volume(shared("totalsegmentator/example_seg_dicom.nii.gz"))
        assert body.unit == "HU"
        np.testing.assert_allclose(body.affine, labels.affine, atol=1e-3)

    def test_a_bone_by_its_gray_levels_lies_on_that_by_its_labels(self) -> None:
        """An upper arm: compact bone is over 200 HU, and its marrow, which is not, is filled in every slice."""
        body = read_volume(shared("totalsegmentator/example_ct_dicom"))
        labels = read_volume(shared("totalsegmentator/example_seg_dicom.nii.gz"))
        near = ndimage.binary_dilation(labels.voxels == ARM, iterations=3)
        solid = np.stack(
            [ndimage.binary_fill_holes(ndimage.binary_closing(one, iterations=2)) for one in (body.voxels > 200) & near]
        )
        bone = replace(body, voxels=solid.astype(np.uint8), unit="stored")
        by_gray = reconstruct(bone, select=(1,), keep="largest", network="none").mesh
        by_label = reconstruct(labels, select=(ARM,), network="none").mesh
        apart = compare(by_gray, by_label)
        across, along = body.spacing_mm[0], body.spacing_mm[2]
        assert max(apart["mean_mm"], apart["back_mean_mm"]) < 0.7 * across
        assert max(apart["p95_mm"], apart["back_p95_mm"]) < along

    def test_mixed_vendors_are_listed_as_three_series(self) -> None:
        folder = shared("derived/mixed_multi_series")
        with pytest.raises(GeometryError, match=r"1: .*; 2: .*; 3: "):
            read_volume(folder)
        assert read_volume(folder, settings=ReadSettings(series=3)).shape == (240, 4, 240)

    def test_a_head_of_mixed_spacing_is_refused_or_interpolated(self) -> None:
        folder = shared("dcm_qa_ct/In/GE")
        with pytest.raises(GeometryError, match=r"varies.*1\.081 to 6\.999 mm"):
            read_volume(folder)
        volume = read_volume(folder, settings=ReadSettings(resample_slices=True))
        assert any("18.5 degrees" in note for note in volume.notes)

    @pytest.mark.parametrize(
        ("name", "error", "word"),
        [
            ("dicom2nifti/failing/sliceincrement", GeometryError, "missing: 1"),
            ("dicom2nifti/failing/sliceorientation", GeometryError, "2 series"),
            ("malformed/no_ipp.dcm", GeometryError, "ImagePositionPatient"),
            ("malformed/no_pixelspacing.dcm", GeometryError, "PixelSpacing"),
            ("malformed/truncated_header.dcm", FormatError, "cut off"),
            ("malformed/text_named.dcm", FormatError, "0 of 1"),
        ],
    )
    def test_faults_are_refused(self, name: str, error: type[Exception], word: str) -> None:
        with pytest.raises(error, match=word):
            read_volume(shared(name))

    def test_a_tilted_gantry_is_not_ignored(self) -> None:
        volume = read_volume(shared("dicom2nifti/failing/gantrytilting"))
        assert volume.notes == ("gantry tilt of 14.0 degrees: the axes are sheared",)
