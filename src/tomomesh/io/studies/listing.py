"""The series of a study, before any of them is read."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from ...settings import ReadSettings
from ..dicom import Listing, is_segmentation, list_dicom, lone_object
from ..dicom.objects.segmentation import segments_of
from ..files.archive import unpacked_zip
from ..files.source import existing, existing_file, suffix_of
from .slices import ARCHIVES, Slices, in_words, slices_among, slices_behind

if TYPE_CHECKING:
    from collections.abc import Sequence


def list_series(path: str | Path | Sequence[str | Path], *, settings: ReadSettings | None = None) -> Listing:
    """List the DICOM series of a study from their headers alone.

    Parameters
    ----------
    path : path, or sequence of path
        As `read_volume` takes it.
    settings : ReadSettings, optional
        Under which each series would be read.

    Returns
    -------
    Listing
        Without series for what is no DICOM, and for a segmentation, whose segments it has.

    Raises
    ------
    UnreadableError
        Where the path is missing or may not be read.
    FormatError
        For a file that is empty, and archives, discs and segmentations that are broken.
    ResourceError
        For an archive that holds too much.
    """
    settings = settings or ReadSettings()
    if not isinstance(path, (str, Path)):
        several = [Path(one) for one in path]
        return _listed(slices_among(several), settings, study=in_words(several))
    path = existing(path)
    if path.is_dir() or suffix_of(existing_file(path)) not in ARCHIVES:
        return _listed(slices_behind(path, str(path)), settings, study=str(path))
    with unpacked_zip(path) as folder:
        return _listed(slices_behind(folder, str(path)), settings, study=str(path))


def _listed(slices: Slices, settings: ReadSettings, *, study: str) -> Listing:
    alone = lone_object(slices.dicom)
    if alone is not None and is_segmentation(alone):
        return Listing(files=1, segments=tuple(segments_of(alone).items()))
    if alone is not None or not slices.dicom:
        return Listing()
    return list_dicom(slices.dicom, settings, study=study, others=slices.others)
