"""NIfTI studies, in one file or as a pair of header and voxels: RAS becomes LPS here."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from ...errors import FormatError
from ...model.volume import Volume
from ..files.detached import beside
from ..files.source import existing_file, suffix_of
from ..files.unpack import packing_of, unpacked
from .gray import scaled, scaled_dtype, stays_finite, without_holes
from .nifti_frame import frame_of
from .nifti_header import NIFTI_HEADERS, NiftiLayout, layout_of, unpack_header
from .raster import Raster, read_raster

if TYPE_CHECKING:
    from pathlib import Path

    from ...settings import ReadSettings

PAIRED = {".hdr": ".img", ".img": ".hdr"}
"""Suffixes of a pair of files, and their partners'."""


def read_nifti(path: Path, settings: ReadSettings) -> Volume:
    """Read a study from a ``.nii`` file or from a ``.hdr`` and its ``.img``, each packed by gzip or not.

    Parameters
    ----------
    path : Path
        The file; of a pair, either, and the other one beside it.
    settings : ReadSettings
        `spacing` stands in for a frame that the file does not hold.

    Returns
    -------
    Volume
        In patient millimeters, LPS. The sform is used where its code is not 0, else the qform (the other way round with
        ``nifti_form="qform"``), else the pixel sizes
        alone, with a note: the standard's method 1, x = pixdim[1] i to the right, y = pixdim[2] j to the front,
        z = pixdim[3] k up.

    Raises
    ------
    UnreadableError, FormatError, GeometryError, ResourceError
        As the header or the voxels demand; `GeometryError` too for Analyze 7.5 without a `spacing`.
    """
    name = str(path)
    front, back = _files(existing_file(path))
    with unpacked(front, packing_of(front), file=name) as stream:
        header = unpack_header(stream.read(max(NIFTI_HEADERS)), settings, paired=front != back, file=name)
    layout = layout_of(header, paired=front != back, file=name)
    affine, notes, other = frame_of(header, settings, layout.shape, name)
    stored, more = _gray(back, layout, name)
    return replace(Volume.from_stored(stored, affine, notes=notes + layout.notes + more), other_frame=other)


def _files(path: Path) -> tuple[Path, Path]:
    """Return the file with the header and that with the voxels; never one outside of the folder."""
    plain = path.with_suffix("") if suffix_of(path).endswith(".gz") else path
    suffix = plain.suffix.lower()
    if suffix not in PAIRED:
        return path, path
    other = PAIRED[suffix].upper() if plain.suffix.isupper() else PAIRED[suffix]
    names = [plain.with_suffix(other + packed).name for packed in ("", ".gz")]
    found = [name for name in names if path.with_name(name).exists()]
    if not found:
        raise FormatError(
            "the other file of the pair is missing",
            file=str(path),
            expected=f"{names[0]} beside it",
            hint="the header together with its voxels",
        )
    partner = beside(path, found[0])
    return (path, partner) if suffix == ".hdr" else (partner, path)


def _gray(path: Path, layout: NiftiLayout, name: str) -> tuple[Any, tuple[str, ...]]:
    """Return voxels (K, J, I[, 3]); they are stored fastest axis first."""
    colors = len(layout.dtype.names or ())
    shape, kind = (*layout.shape[::-1], *([colors] if colors else [])), layout.dtype
    raster = Raster(shape, np.dtype(np.uint8) if colors else kind, packing_of(path), (path,), skip=layout.offset)
    stored = read_raster(raster, file=name)
    if colors:
        return stored[:, :, :, :3], ()
    scale = layout.slope, layout.intercept
    dtype = scaled_dtype(stored.dtype, [scale])
    levels = scaled(stored, *scale, dtype)
    return (levels, ()) if stays_finite(stored.dtype, scale, dtype) else without_holes(levels, file=name)
