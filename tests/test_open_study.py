"""Studies that are read part by part: to the last bit what reading them whole gives, in every format."""

from __future__ import annotations

import pickle
import zipfile
from typing import TYPE_CHECKING, Any, NamedTuple

import nibabel
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from pydicom.uid import RLELossless

from conftest import law
from studies import AFFINES, LPS_TO_RAS, TURNED, as_ct, enhanced, save, setting, write_series
from tomomesh.errors import ResourceError
from tomomesh.io import open_study, read_volume
from tomomesh.io.files import limits
from tomomesh.io.studies.read import WHOLE
from tomomesh.model.lazy import in_memory
from tomomesh.settings import ReadSettings
from writers import (
    needed,
    with_itk,
    with_nibabel,
    with_numpy,
    with_ome_tiff,
    with_pillow,
    with_pydicom,
    with_pynrrd,
    with_qform,
    with_tifffile,
    with_zarr,
)

if TYPE_CHECKING:
    from pathlib import Path

    from numpy.typing import NDArray

    from tomomesh.model.volume import Volume
    from writers import Writer

PLAIN = ReadSettings()
SPACING = ReadSettings(spacing=(0.5, 0.7, 2.0))
RNG = np.random.default_rng(15)
STORED = RNG.integers(0, 2000, (9, 11, 13), np.int16)
BYTES = STORED.astype(np.uint8)
COLORS = RNG.integers(0, 255, (9, 11, 13, 3), np.uint8)
SPARSE = np.where(np.indices((9, 11, 13)).sum(axis=0) < 12, STORED, 0).astype(np.int16)
"""What a corner holds alone: writers leave the chunks out that are far from it."""


def holed(stored: NDArray[Any]) -> NDArray[np.float32]:
    """Return real numbers, of which some are none."""
    numbers = (stored - 700.25).astype(np.float32)
    numbers[2, 3, 4:9] = np.nan
    numbers[5, :2, 0] = np.inf
    return numbers


def nifti(dtype: str = "<i2", **fields: float) -> Writer:
    def write(folder: Path, stored: NDArray[Any], affine: NDArray[np.float64]) -> Path:
        header = nibabel.Nifti1Header(endianness=dtype[0] if dtype[0] in "<>" else "<")
        header.set_data_dtype(dtype)
        image = nibabel.Nifti1Image(stored.T.astype(dtype), LPS_TO_RAS @ affine, header)
        for field, value in fields.items():
            image.header[field] = value
        raw = image.to_bytes()
        edited = nibabel.Nifti1Header(raw[:348], check=False)
        for field, value in fields.items():
            edited[field] = value
        (folder / "s.nii").write_bytes(edited.binaryblock + raw[348:])
        return folder / "s.nii"

    return write


def colored_nifti(folder: Path, stored: NDArray[Any], affine: NDArray[np.float64]) -> Path:
    rgb = stored.view([("R", "u1"), ("G", "u1"), ("B", "u1")])[..., 0]
    nibabel.save(nibabel.Nifti1Image(rgb.T, affine), folder / "s.nii.gz")
    return folder / "s.nii.gz"


def nrrd(**header: Any) -> Writer:
    def write(folder: Path, stored: NDArray[Any], affine: NDArray[np.float64]) -> Path:
        told = {"space": "LPS", "space directions": affine[:3, :3].T, "space origin": affine[:3, 3]} | header
        needed("nrrd").write(str(folder / "s.nrrd"), stored.T, told)
        return folder / "s.nrrd"

    return write


def colored_nrrd(folder: Path, stored: NDArray[Any], affine: NDArray[np.float64]) -> Path:
    directions = np.vstack([np.full((1, 3), np.nan), affine[:3, :3].T])
    told = {"space": "LPS", "space directions": directions, "kinds": ["RGB-color", *3 * ["domain"]]}
    needed("nrrd").write(str(folder / "s.nrrd"), stored.transpose(3, 2, 1, 0), told)
    return folder / "s.nrrd"


def in_slices(suffix: str) -> Writer:
    """Return a writer of a header that names a file a slice, of NRRD or of MetaImage."""

    def write(folder: Path, stored: NDArray[Any], affine: NDArray[np.float64]) -> Path:
        for k, pixels in enumerate(stored):
            (folder / f"s{k}.raw").write_bytes(pixels.astype("<i2").tobytes())
        sizes = " ".join(map(str, stored.shape[::-1]))
        names = "\n".join(f"s{k}.raw" for k in range(len(stored)))
        nhdr = f"NRRD0004\ntype: short\ndimension: 3\nsizes: {sizes}\nencoding: raw\nendian: little\n"
        nhdr += f"space: LPS\nspace directions: (0.5,0,0) (0,0.7,0) (0,0,2)\ndata file: LIST\n{names}\n"
        mhd = f"NDims = 3\nDimSize = {sizes}\nElementSpacing = 0.5 0.7 2\nElementType = MET_SHORT\n"
        mhd += f"ElementByteOrderMSB = False\nElementDataFile = LIST\n{names}\n"
        (folder / f"s{suffix}").write_text(nhdr if suffix == ".nhdr" else mhd)
        return folder / f"s{suffix}"

    return write


def tiff(**how: Any) -> Writer:
    def write(folder: Path, stored: NDArray[Any], affine: NDArray[np.float64]) -> Path:
        needed("tifffile").imwrite(folder / "s.tif", stored, **({"metadata": None} | how))
        return folder / "s.tif"

    return write


def pages_one_by_one(folder: Path, stored: NDArray[Any], affine: NDArray[np.float64]) -> Path:
    with needed("tifffile").TiffWriter(folder / "s.tif") as pages:
        for pixels in stored:
            pages.write(pixels, compression="zlib")
    return folder / "s.tif"


def store(**how: Any) -> Writer:
    def write(folder: Path, stored: NDArray[Any], affine: NDArray[np.float64]) -> Path:
        needed("zarr")
        import stores

        return stores.write(folder / "s.zarr", stored, **how)

    return write


def plain_zarr(folder: Path, stored: NDArray[Any], affine: NDArray[np.float64]) -> Path:
    array = needed("zarr").create_array(folder / "s.zarr", shape=stored.shape, dtype=stored.dtype, chunks=stored.shape)
    array[...] = stored
    return folder / "s.zarr"


def series(*edits: Any, slices: list[int] | None = None) -> Writer:
    def edit(data: Any, k: int) -> None:
        for one in edits:
            one(data, k)

    return lambda folder, stored, affine: write_series(folder / "series", stored, affine, edit, slices)


def packed(data: Any, k: int) -> None:
    data.compress(RLELossless)


def twice(folder: Path, stored: NDArray[Any], affine: NDArray[np.float64]) -> Path:
    write_series(folder / "series" / "a", stored, affine)
    write_series(folder / "series" / "b", stored, affine)
    return folder / "series"


def multiframe(folder: Path, stored: NDArray[Any], affine: NDArray[np.float64]) -> Path:
    return save(enhanced(stored, affine, [3, 0, 8, 1, 2, 7, 4, 6, 5]), folder / "s.dcm")


SCALES = tuple(1 + k % 3 for k in range(9))


class Case(NamedTuple):
    """A writer, what it writes, and how that is read."""

    write: Writer
    stored: Any = STORED
    settings: ReadSettings = PLAIN
    affine: Any = TURNED["left-handed"]


UPRIGHT = AFFINES["axial"]

CASES = {
    "nii": Case(nifti()),
    "nii.gz": Case(with_nibabel(".nii.gz")),
    "nii qform": Case(with_qform),
    "nii big-endian": Case(nifti(">i2")),
    "nii whole scale": Case(nifti(scl_slope=2, scl_inter=-1024)),
    "nii real scale": Case(nifti("<u2", scl_slope=0.25, scl_inter=-3.5)),
    "nii holes": Case(nifti("<f4"), holed(STORED)),
    "nii holes, big-endian, scaled": Case(nifti(">f8", scl_slope=0.3, scl_inter=7), holed(STORED)),
    "nii colors": Case(colored_nifti, COLORS, affine=UPRIGHT),
    "hdr": Case(with_nibabel(".hdr")),
    "nrrd": Case(with_itk(".nrrd")),
    "nrrd gzip": Case(with_itk(".nrrd", True)),
    "nrrd bzip2": Case(nrrd(encoding="bz2")),
    "nrrd holes": Case(nrrd(encoding="raw"), holed(STORED)),
    "nrrd colors": Case(colored_nrrd, COLORS, affine=UPRIGHT),
    "nrrd big-endian": Case(nrrd(encoding="raw", endian="big"), STORED.astype(">i2")),
    "nhdr": Case(with_pynrrd(".nhdr")),
    "nhdr, a file a slice": Case(in_slices(".nhdr")),
    "mha": Case(with_itk(".mha")),
    "mha zlib": Case(with_itk(".mha", True)),
    "mhd": Case(with_itk(".mhd")),
    "mhd, a file a slice": Case(in_slices(".mhd")),
    "mgh": Case(with_nibabel(".mgh")),
    "mgz": Case(with_nibabel(".mgz")),
    "npy": Case(with_numpy, settings=SPACING),
    "npy by columns": Case(with_numpy, np.asfortranarray(STORED), SPACING),
    "npy big-endian": Case(with_numpy, STORED.astype(">u4"), SPACING),
    "npy truth": Case(with_numpy, STORED > 1000, SPACING),
    "npy colors": Case(with_numpy, COLORS, SPACING),
    "npy batch of one": Case(with_numpy, holed(STORED)[None, None], SPACING),
    "tif": Case(with_tifffile, settings=SPACING),
    "tif big-endian": Case(tiff(byteorder=">"), settings=SPACING),
    "tif packed": Case(tiff(compression="zlib"), settings=SPACING),
    "tif bright is low": Case(tiff(photometric="miniswhite"), STORED.astype(np.uint16), SPACING),
    "tif bright is low, packed": Case(tiff(photometric="miniswhite", compression="zlib"), BYTES, SPACING),
    "tif truth": Case(tiff(), STORED > 1000, SPACING),
    "tif colors": Case(tiff(photometric="rgb"), COLORS, SPACING),
    "tif colors in planes": Case(
        tiff(photometric="rgb", planarconfig="separate"), np.ascontiguousarray(COLORS.transpose(0, 3, 1, 2)), SPACING
    ),
    "tif tiles": Case(tiff(tile=(16, 16)), settings=SPACING),
    "tif holes": Case(tiff(compression="zlib"), holed(STORED), SPACING),
    "tif one by one": Case(pages_one_by_one, settings=SPACING),
    "tif of imagej": Case(tiff(imagej=True, metadata={"axes": "ZYX"}), STORED.astype(np.uint16), SPACING),
    "ome-tiff": Case(with_ome_tiff, affine=UPRIGHT),
    "png": Case(with_pillow(".png"), STORED.astype(np.uint16), SPACING),
    "tif slices": Case(with_pillow(".tif"), STORED.astype(np.uint16), SPACING),
    "jpg": Case(with_pillow(".jpg"), COLORS, SPACING),
    "zarr 2": Case(with_zarr(2), affine=UPRIGHT),
    "zarr 3": Case(with_zarr(3), affine=UPRIGHT),
    "zarr shards": Case(store(chunks=(2, 2, 2), shards=(4, 4, 6))),
    "zarr big-endian": Case(store(zarr_format=2), STORED.astype(">i4")),
    "zarr left out": Case(store(), SPARSE),
    "zarr holes": Case(store(), holed(STORED)),
    "zarr plain": Case(plain_zarr, settings=SPACING),
    "zarr plain colors": Case(plain_zarr, COLORS, SPACING),
    "dicom": Case(with_pydicom),
    "dicom ct": Case(series(as_ct, setting(RescaleSlope="1", RescaleIntercept="-1024"))),
    "dicom other scale a slice": Case(series(setting(RescaleSlope=SCALES, RescaleIntercept=0.5))),
    "dicom padding": Case(
        series(as_ct, setting(RescaleSlope=SCALES, RescaleIntercept=-1024, PixelPaddingValue=int(STORED[0, 0, 0])))
    ),
    "dicom dark is high": Case(series(setting(PhotometricInterpretation="MONOCHROME1"))),
    "dicom gaps": Case(series(slices=[0, 1, 2, 5, 6, 8]), settings=ReadSettings(fill_gaps=True)),
    "dicom packed": Case(series(packed)),
    "dicom skip bad": Case(series(), settings=ReadSettings(skip_bad=True)),
    "dicom twice": Case(twice),
    "dicom frames": Case(multiframe),
    "dicom colors": Case(series(), COLORS),
}


@pytest.fixture(scope="module", params=CASES)
def both(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> tuple[Volume, Volume]:
    """A study read whole, and opened."""
    case = CASES[request.param]
    path = case.write(tmp_path_factory.mktemp("study"), case.stored, case.affine)
    return read_volume(path, settings=case.settings), open_study(path, case.settings)


def test_all_but_the_voxels_is_the_same(both: tuple[Volume, Volume]) -> None:
    whole, lazy = both
    assert lazy.in_parts is not None
    assert whole.in_parts is None
    assert (lazy.shape, lazy.layers, lazy.in_parts.dtype) == (whole.shape, whole.layers, whole.voxels.dtype)
    assert (lazy.notes, lazy.unit, lazy.padding, lazy.other_frame, lazy.dicom) == (
        whole.notes, whole.unit, whole.padding, whole.other_frame, whole.dicom,
    )  # fmt: skip
    np.testing.assert_array_equal(lazy.affine, whole.affine)
    np.testing.assert_array_equal(lazy.grid.affine, whole.grid.affine)


@law(12)
@given(axis=st.integers(0, 2), data=st.data())
def test_any_part_has_the_same_voxels(both: tuple[Volume, Volume], axis: int, data: st.DataObject) -> None:
    sides = [sorted(data.draw(st.tuples(*2 * [st.integers(0, size)]))) for size in both[0].shape]
    box = slice(*sides[0]), slice(*sides[1]), slice(*sides[2])
    whole, lazy = (volume.cropped(box).along(axis) for volume in both)
    assert lazy.in_parts is not None
    np.testing.assert_array_equal(lazy.in_parts.read(), whole.voxels, strict=True)
    step = data.draw(st.sampled_from([-3, -1, 2]))
    np.testing.assert_array_equal(in_memory(lazy.voxels[::step, ::-1]), whole.voxels[::step, ::-1], strict=True)


def test_another_process_reads_the_same(both: tuple[Volume, Volume]) -> None:
    whole, lazy = both
    sent = pickle.loads(pickle.dumps(lazy))
    np.testing.assert_array_equal(in_memory(sent.voxels), whole.voxels, strict=True)
    np.testing.assert_array_equal(sent.voxels[3], whole.voxels[3], strict=True)


ONE_CHUNK = ("zarr 2", "zarr 3", "zarr plain", "zarr plain colors")


@pytest.mark.parametrize("name", [name for name in CASES if name not in ONE_CHUNK])
def test_one_larger_than_the_memory_is_opened(name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    case = CASES[name]
    path = case.write(tmp_path, case.stored, case.affine)
    expected = read_volume(path, settings=case.settings)
    monkeypatch.setattr(limits, "physical_memory", lambda: case.stored.nbytes - 1)
    with pytest.raises(ResourceError, match="memory"):
        read_volume(path, settings=case.settings)
    monkeypatch.chdir(tmp_path)
    opened = open_study(path.relative_to(tmp_path), case.settings)
    monkeypatch.chdir("/")  # a worker may be anywhere
    np.testing.assert_array_equal(opened.voxels[4], expected.voxels[4], strict=True)


class TestWhatCannotBeReadInParts:
    @pytest.mark.parametrize("encoding", ["ascii", "hex"])
    def test_text_is_read_whole_and_that_is_said(self, tmp_path: Path, encoding: str) -> None:
        path = nrrd(encoding="ascii")(tmp_path, STORED, UPRIGHT)
        if encoding == "hex":
            header = path.read_bytes().split(b"\n\n")[0].replace(b"encoding: ascii", b"encoding: hex\nendian: little")
            path.write_bytes(header + b"\n\n" + STORED.tobytes().hex().encode())
        opened, whole = open_study(path), read_volume(path)
        assert opened.in_parts is None
        assert opened.notes == (*whole.notes, WHOLE)
        np.testing.assert_array_equal(opened.voxels, whole.voxels, strict=True)

    def test_so_is_an_archive_and_no_file_of_it_stays(self, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
        path = nifti()(tmp_path, STORED, UPRIGHT)
        (tmp_path / "temporary").mkdir()
        monkeypatch.setattr("tempfile.tempdir", str(tmp_path / "temporary"))
        with zipfile.ZipFile(tmp_path / "s.zip", "w") as archive:
            archive.write(path, path.name)
        opened = open_study(tmp_path / "s.zip")
        assert opened.notes[-1] == WHOLE
        np.testing.assert_array_equal(opened.voxels, read_volume(path).voxels, strict=True)
        assert not list((tmp_path / "temporary").iterdir())

    def test_text_beyond_the_memory_is_refused(self, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
        path = nrrd(encoding="ascii")(tmp_path, STORED, UPRIGHT)
        monkeypatch.setattr(limits, "physical_memory", lambda: STORED.nbytes - 1)
        with pytest.raises(ResourceError, match="memory"):
            open_study(path)
