"""How large a study is, by its headers."""

from __future__ import annotations

from typing import TYPE_CHECKING

from ..files.limits import promised_by
from ..files.source import existing
from ..volumes.zarr.omezarr import is_zarr
from .read import read_volume

if TYPE_CHECKING:
    from ...settings import ReadSettings
    from .folder import Study


def voxel_bytes(study: Study, settings: ReadSettings) -> int:
    """Return the bytes of a study's voxels as they will be in memory, from its headers alone; some count these too.

    Slices count as many times their first. What tells nothing, as a study that is broken, counts as its files.
    """
    whole = study.path.is_file() or is_zarr(study.path)
    one = study.path if whole else study.files[:2]
    promised = promised_by(lambda: read_volume(one, settings=settings))
    if whole and promised:
        return promised
    return promised * len(study.files) or sum(existing(file).stat().st_size for file in study.files)
