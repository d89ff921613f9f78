"""A study from whatever holds it."""

from __future__ import annotations

from collections import Counter
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from ...errors import FormatError, UnreadableError, UsageError
from ...settings import ReadSettings
from ..dicom import index_in, is_dicom, is_index, is_segmentation, lone_object, read_dicom, read_index
from ..dicom.headers.kinds import STRUCTURES, storage_class
from ..dicom.objects.segmentation import read_segmentation
from ..files.archive import unpacked_zip
from ..files.parts import Each, reading_later
from ..files.source import counted, existing, existing_file, regular_files, suffix_of
from ..volumes.images import FAMILIES, read_images
from ..volumes.metaimage import read_metaimage
from ..volumes.mgh import read_mgh
from ..volumes.nifti import read_nifti
from ..volumes.npy import read_npy_volume
from ..volumes.nrrd.nrrd import read_nrrd
from ..volumes.tiff import read_tiff
from ..volumes.zarr.omezarr import is_zarr, read_omezarr
from .slices import ARCHIVES, Slices, in_words, slices_among, slices_in

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from ...model.volume import Volume


def _read_one_dicom(
    path: Path, settings: ReadSettings, select: Sequence[int] | None = None, *, study: str = ""
) -> Volume:
    study = study or str(path)
    if storage_class(path) == STRUCTURES:
        raise FormatError(
            "the file holds contours, no voxels",
            file=study,
            found="an RT Structure Set",
            hint=f"tomomesh surface {path.name} --structure N, which takes one of its structures",
        )
    if is_segmentation(path):
        return read_segmentation(path, settings, study=study, select=select)
    return read_dicom([path], settings, study=study)


def _read_zip(path: Path, settings: ReadSettings, select: Sequence[int] | None = None) -> Volume:
    """Read the slices in an archive, or the only volume; archives inside it are not opened."""
    with unpacked_zip(path) as folder, reading_later(None):  # the folder is gone afterwards
        files, _ = regular_files(folder, deep=True)
        stores = [folder] if is_zarr(folder) else [path for path in folder.iterdir() if path.is_dir() and is_zarr(path)]
        whole = stores + [file for file in volumes_among(files) if suffix_of(file) not in ARCHIVES]
        one = len(whole) == 1 and not any(map(is_dicom, files))
        return read_volume(whole[0] if one else folder, settings=settings, select=select)


VOLUME_READERS: dict[str, Callable[[Path, ReadSettings], Volume]] = {
    ".nii": read_nifti,
    ".nii.gz": read_nifti,
    ".hdr": read_nifti,
    ".hdr.gz": read_nifti,
    ".img": read_nifti,
    ".img.gz": read_nifti,
    ".nrrd": read_nrrd,
    ".nhdr": read_nrrd,
    ".mha": read_metaimage,
    ".mhd": read_metaimage,
    ".mgh": read_mgh,
    ".mgz": read_mgh,
    ".npy": read_npy_volume,
    ".tif": read_tiff,
    ".tiff": read_tiff,
    ".dcm": _read_one_dicom,
    ".ima": _read_one_dicom,
    ".zip": _read_zip,
    ".ozx": _read_zip,
}
"""Suffix of a single file to its reader; folders, and DICOM of any name, are known by their content."""

READABLE = "a folder of DICOM, PNG, TIFF or JPEG slices, of OME-Zarr, a DICOM file, " + " | ".join(
    suffix for suffix in VOLUME_READERS if suffix not in (".dcm", ".ima")
)


WHOLE = "read whole into the memory: files of this kind cannot be read in parts"
"""The note on a study that was to be read in parts."""

VOXELS = (".img", ".img.gz")
"""Suffixes of files that belong to a header beside them."""


def volumes_among(files: Sequence[Path]) -> list[Path]:
    """Return the volume files among some; of a NIfTI pair its header alone."""
    return [path for path in files if suffix_of(path) in VOLUME_READERS and suffix_of(path) not in VOXELS]


def read_volume(
    path: str | Path | Sequence[str | Path],
    *,
    settings: ReadSettings | None = None,
    select: Sequence[int] | None = None,
) -> Volume:
    """Read a study.

    Parameters
    ----------
    path : path, or sequence of path
        A DICOM, NIfTI, NRRD, MetaImage, MGH, NPY or multi-page TIFF file, a folder of DICOM, PNG, TIFF or JPEG
        slices or of OME-Zarr, a DICOMDIR, or a zip file of one of these. Several files are the slices of one study.
    settings : ReadSettings, optional
        What to do where the files leave a choice.
    select : sequence of int, optional
        The labels that are wanted. Of a DICOM segmentation, or Slicer's of several layers, whose segments may overlap,
        only these are read; any other label map is read whole.

    Returns
    -------
    Volume
        Voxels in canonical order with their affine, patient millimeters, LPS; its `notes` say what was
        decided on the way.

    Raises
    ------
    UnreadableError
        Where the path is missing, empty or may not be read.
    FormatError
        For files that are broken or of an unknown kind.
    GeometryError
        Where the geometry is inconsistent, or needs a flag.
    UsageError
        For a series that there is not.
    ResourceError
        Where the voxels do not fit into the memory.

    Examples
    --------
    >>> import nibabel
    >>> import numpy as np
    >>> from tomomesh import read_volume
    >>> stored = np.arange(24, dtype=np.int16).reshape(2, 3, 4)
    >>> nibabel.save(nibabel.Nifti1Image(stored, np.diag([0.5, 0.5, 2.0, 1.0])), "study.nii.gz")
    >>> study = read_volume("study.nii.gz")
    >>> study
    Volume(4 x 3 x 2 of int16, 0.5 x 0.5 x 2 mm)
    """
    settings = settings or ReadSettings()
    if not isinstance(path, (str, Path)):
        return _read_named([Path(one) for one in path], settings, select)
    path = existing(path)
    if path.is_dir() and is_zarr(path):
        return read_omezarr(path, settings)
    if path.is_dir():
        return _read_folder(path, settings, select)
    existing_file(path)
    if is_index(path):
        return read_index(path, settings, study=str(path))
    reader = VOLUME_READERS.get(suffix_of(path))
    if reader is _read_one_dicom or (reader is None and is_dicom(path)):
        return _read_one_dicom(path, settings, select)
    if reader is _read_zip:
        return _read_zip(path, settings, select)
    if reader is read_nrrd:
        return read_nrrd(path, settings, select)
    if reader is None:
        raise FormatError(
            "the file is of an unknown kind",
            file=str(path),
            found=f"suffix = {suffix_of(path) or 'none'}",
            expected=READABLE,
            hint="the folder of the slices" if suffix_of(path) in FAMILIES else "",
        )
    return reader(path, settings)


def open_study(
    path: str | Path | Sequence[str | Path],
    settings: ReadSettings | None = None,
    *,
    select: Sequence[int] | None = None,
    each: Each = map,
) -> Volume:
    """Open a study whose voxels are read later, part by part: it may be larger than the memory.

    Parameters
    ----------
    path, settings, select
        As `read_volume`.
    each : callable
        Who goes through all voxels where that cannot wait, those of real numbers, in search of NaN: ``each(work,
        parts)`` returns what the work finds in every part, as `map` does, one after another. Both can be pickled.

    Returns
    -------
    Volume
        As `read_volume` returns it, but its `voxels` are a `LazyVoxels`. What gzip, zlib or bzip2 pack is unpacked into
        a private file first. Of archives, DICOM segmentations, segments in several layers, and voxels written as text,
        no part can be read alone: they are read whole, and a note says so.

    Raises
    ------
    UnreadableError, FormatError, GeometryError, UsageError, ResourceError
        As `read_volume`; what lies in a damaged part is told when that is read.
    """
    with reading_later(each):
        opened = read_volume(path, settings=settings, select=select)
    return opened if opened.in_parts is not None else replace(opened, notes=(*opened.notes, WHOLE))


def _read_folder(folder: Path, settings: ReadSettings, select: Sequence[int] | None) -> Volume:
    """Read what its DICOMDIR names, all DICOM below it, or its images; where it holds none, those of sub-folders."""
    if (index := index_in(folder)) is not None:
        return read_index(index, settings, study=str(folder))
    return _read_slices(slices_in(folder), settings, select, study=str(folder))


def _read_named(paths: list[Path], settings: ReadSettings, select: Sequence[int] | None) -> Volume:
    """Read the study whose files are named one by one: one alone, slices, or a header and what belongs to it."""
    if len(paths) < 2:
        if not paths:
            raise UsageError("there is no study", found="0 files", expected="the slices of one")
        return read_volume(paths[0], settings=settings, select=select)
    slices = slices_among(paths)
    if len(whole := volumes_among(slices.rest)) == 1:
        return read_volume(whole[0], settings=settings, select=select)
    return _read_slices(slices, settings, select, study=in_words(paths))


def _read_slices(slices: Slices, settings: ReadSettings, select: Sequence[int] | None, *, study: str) -> Volume:
    """Read all DICOM among some files, or all images."""
    if (alone := lone_object(slices.dicom)) is not None:
        return _read_one_dicom(alone, settings, select, study=study)
    if slices.dicom:
        return read_dicom(slices.dicom, settings, study=study, others=slices.others)
    if slices.images:
        return read_images(slices.images, settings, folder=study)
    others = slices.others + Counter(_kind(path) for path in slices.rest)
    if not others:
        raise UnreadableError("the folder is empty", file=study, expected=READABLE)
    raise FormatError(
        f"0 of {sum(others.values())} files are images",
        file=study,
        found=counted(others),
        expected=READABLE,
        hint="the file of the volume itself, not its folder" if volumes_among(slices.rest) else "",
    )


def _kind(path: Path) -> str:
    return f"{suffix_of(path)} files" if suffix_of(path) in VOLUME_READERS else "of an unknown kind"
