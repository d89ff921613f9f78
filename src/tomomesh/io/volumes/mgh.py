"""MGH and MGZ, FreeSurfer's volumes; nibabel knows the header, RAS becomes LPS here."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from ...errors import FormatError
from ...model.volume import Volume
from ..files.limits import require_bytes
from ..files.source import existing_file, third_party
from ..files.unpack import packing_of, unpacked
from .affine import check_affine, check_spacing, passed_over
from .gray import without_holes
from .nifti_frame import FLIP
from .raster import Raster, read_raster

if TYPE_CHECKING:
    from pathlib import Path

    from numpy.typing import NDArray

    from ...settings import ReadSettings

MGH_HEADER_BYTES = 284
"""Bytes before the first voxel (FreeSurfer's wiki, MghFormat; so are all below)."""

MGH_FIELD_BYTES = 90
"""Those of them that hold something."""

HAS_FRAME = slice(28, 30)
"""Those that say whether the frame counts, 1 or 0; nibabel puts the default frame and 1 in place of 0."""

MGH_TYPES = {0: ">u1", 1: ">i4", 3: ">f4", 4: ">i2", 10: ">u2"}
"""The format's types to NumPy's."""

MGH_HINT = "a file with a valid header"


def read_mgh(path: Path, settings: ReadSettings) -> Volume:
    """Read a study from a ``.mgh`` or ``.mgz`` file.

    Parameters
    ----------
    path : Path
        The file.
    settings : ReadSettings
        Not used but for a note: the file holds its own frame.

    Returns
    -------
    Volume
        In patient millimeters, LPS.

    Raises
    ------
    UnreadableError, FormatError, GeometryError, ResourceError
        As the header or the voxels demand.
    """
    path, name = existing_file(path), str(path)
    packing = packing_of(path)
    with unpacked(path, packing, file=name) as stream:
        start = stream.read(MGH_HEADER_BYTES)
    header = _header(start, name)
    shape, dtype = _layout(header, name)
    affine, notes = _frame(header, start[HAS_FRAME] == b"\0\1", name)
    raster = Raster(shape[::-1], dtype, packing, (path,), skip=MGH_HEADER_BYTES)
    voxels, more = without_holes(read_raster(raster, file=name), file=name)
    return Volume.from_stored(voxels, affine, notes=notes + passed_over(settings.spacing) + more)


def _header(start: bytes, name: str) -> Any:
    require_bytes(MGH_HEADER_BYTES, len(start), file=name)
    from nibabel.freesurfer.mghformat import MGHHeader

    with third_party("nibabel", name):
        header = MGHHeader(start[:MGH_FIELD_BYTES], check=False)
    if int(header["version"]) != 1:
        found = f"version = {int(header['version'])}"
        raise FormatError("the file is no MGH file", file=name, found=found, expected="version 1")
    return header


def _layout(header: Any, name: str) -> tuple[tuple[int, int, int], np.dtype[Any]]:
    """Return the sizes I, J, K and the type of a voxel."""
    sizes, code = [int(size) for size in header["dims"]], int(header["type"])
    if min(sizes) < 1:
        raise FormatError(
            "the sizes of the volume are invalid", file=name, found=f"dims = {sizes}", expected="all over 0"
        )
    if sizes[3] > 1:
        hint = "one frame, written to a file of its own"
        raise FormatError("the file holds several frames", file=name, found=f"dims = {sizes}", hint=hint)
    if code not in MGH_TYPES:
        raise FormatError("the voxels are of an unknown kind", file=name, found=f"type = {code}")
    return (sizes[0], sizes[1], sizes[2]), np.dtype(MGH_TYPES[code])


def _frame(header: Any, good: bool, name: str) -> tuple[NDArray[np.float64], tuple[str, ...]]:
    """Return the affine in millimeters, LPS; where the file marks its own as no good, FreeSurfer's default."""
    if good:
        spacing = [float(size) for size in header["delta"]]
        check_spacing(spacing, ["delta[0]", "delta[1]", "delta[2]"], file=name, hint=MGH_HINT)
    with third_party("nibabel", name):
        affine = FLIP @ np.asarray(header.get_affine(), np.float64)
    check_affine(affine, file=name, hint=MGH_HINT)
    return affine, () if good else ("the file has no frame: FreeSurfer's own, coronal slices of 1 mm",)
