"""One Zarr array of a local folder: which chunks are there, and whether they hold what they should.

zarr-python takes a chunk that is missing for the fill value, which is right where the writer left it out and wrong
where it was lost; blosc unpacks a chunk that is cut off by some bytes; links are followed, and a filter of pickled
objects would be run. Hence the guards in front of it.
"""

from __future__ import annotations

import json
import math
import os
import stat
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from ....errors import FormatError, ResourceError
from ...files.detached import beside
from ...files.extras import required
from ...files.limits import require_memory
from ...files.source import third_party, whole
from ..gray import native
from .packed_chunk import promised_bytes

if TYPE_CHECKING:
    from numpy.typing import NDArray

DOCUMENTS = ("zarr.json", ".zarray")
"""The files that describe an array, of formats 3 and 2."""

CODECS = {
    "blosc", "zstd", "gzip", "zlib", "bz2", "lz4", "lzma", "crc32", "crc32c", "adler32", "fletcher32",
    "jenkins_lookup3", "bytes", "endian", "transpose", "sharding_indexed", "shuffle", "delta", "bitround",
    "fixedscaleoffset", "quantize", "packbits", "astype",
}  # fmt: skip
"""What zarr and numcodecs unpack by themselves, and without running what a file holds."""

MOST_CHUNKS = 2**22
"""Most chunks that an array may have; of 64 cubed voxels, a usual size, they are a million million voxels."""

TORN = 0.25
"""A missing chunk was lost where more than this part of the voxels beside it differ from the fill value: what writers
leave out is background, which an object touches in part at most; around a lost part of it, it is on all sides."""


def document_of(folder: Path, name: str, *, file: str) -> dict[str, Any]:
    """Return a JSON document of a folder, empty where there is none.

    Raises
    ------
    FormatError
        For other text, and for a link that leaves the folder.
    """
    if not (folder / name).exists():
        return {}
    with third_party("the JSON parser", file):
        found = json.loads(whole(beside(folder / name, name)))
        return dict(found)


def open_array(folder: Path, *, file: str) -> Any:
    """Return zarr's array of a folder, once its codecs and sizes are known to be harmless.

    Raises
    ------
    FormatError
        Where there is none, for unknown codecs, and where zarr is not installed.
    ResourceError
        Where it does not fit into the memory.
    """
    zarr = required("zarr", file=file)
    version = 3 if (folder / DOCUMENTS[0]).exists() else 2
    described = document_of(folder, DOCUMENTS[3 - version], file=file)
    _check_codecs(described, file)
    with third_party("zarr", file):
        store = zarr.storage.LocalStore(folder, read_only=True)
        array = zarr.open_array(store, mode="r", zarr_format=version)
        unit = math.prod(array.shards or array.chunks)
    require_memory(max(math.prod(array.shape), unit) * array.dtype.itemsize, file=file)
    if 0 in array.shape or math.prod(_grid(array)) > MOST_CHUNKS:
        found = f"shape = {array.shape}, chunks = {array.chunks}"
        raise FormatError("the sizes of the array are invalid", file=file, found=found)
    return array


def _check_codecs(described: dict[str, Any], file: str) -> None:
    with third_party("zarr", file):
        unknown = [name for name in _codecs(described) if name.removeprefix("numcodecs.") not in CODECS]
    if unknown:
        raise FormatError(
            "the chunks are packed in a way that cannot be unpacked",
            file=file,
            found=f"codec = {unknown[0][:80]}",
            expected="blosc, zstd, gzip or another of numcodecs' own",
            hint="a copy packed by zstd, written with the package that has this codec",
        )


def _codecs(described: Any) -> list[str]:
    """Return the names of all codecs, those inside of shards too."""
    nested = [described.get(key) or [] for key in ("compressor", "filters", "codecs", "index_codecs")]
    codecs = [one for codec in nested for one in (codec if isinstance(codec, list) else [codec])]
    names = [str(codec.get("id") or codec["name"]) for codec in codecs]
    return names + [name for codec in codecs for name in _codecs(codec.get("configuration") or {})]


def _grid(array: Any) -> tuple[int, ...]:
    """Return how many chunks, or shards, lie along each axis."""
    return tuple(-(-size // chunk) for size, chunk in zip(array.shape, array.shards or array.chunks, strict=True))


def read_array(array: Any, folder: Path, *, fill_chunks: bool, file: str) -> tuple[NDArray[Any], tuple[str, ...]]:
    """Read all voxels, and say how many chunks there are not.

    Parameters
    ----------
    array : zarr.Array
        Of `open_array`.
    folder : Path
        Where it lies.
    fill_chunks : bool
        Whether missing chunks are taken for the fill value whatever lies beside them.

    Raises
    ------
    FormatError
        For damaged chunks, and for missing ones that were not left out because they hold the fill value.
    """
    files = _files(folder, file)
    missing = _missing(array, files)
    _check_lengths(array, files, file)
    with third_party("zarr", file):
        voxels = array[...]
    voxels = native(voxels, file=file)
    if not missing.any():
        return voxels, ()
    fill, told = array.fill_value, f"{int(missing.sum())} of {missing.size}"
    if missing.all() or not (fill_chunks or _are_fill(voxels, missing, array.shards or array.chunks, fill)):
        raise FormatError(
            "chunks of the array are missing",
            file=file,
            found=f"missing = {told}",
            expected=f"all of them, or gaps among voxels of the fill value {fill}",
            hint="" if missing.all() else f"a fresh copy of the folder, or --fill-chunks, which takes them for {fill}",
        )
    return voxels, (f"chunks that are not in the file, taken for the fill value {fill}: {told}",)


def _files(folder: Path, file: str) -> dict[str, Path]:
    """Return the files of an array by their keys; nothing is opened where one of them is a link."""
    found = {}
    for parent, folders, names in os.walk(folder):
        for path in (Path(parent, name) for name in (*folders, *names)):
            kind = path.lstat().st_mode
            if not (stat.S_ISREG(kind) or stat.S_ISDIR(kind)):
                expected = "the chunks themselves, no links"
                raise FormatError(
                    "a chunk is no regular file", file=file, found=f"chunk = {path.name}", expected=expected
                )
            if stat.S_ISREG(kind):
                found[path.relative_to(folder).as_posix()] = path
    return found


def _missing(array: Any, files: dict[str, Path]) -> NDArray[np.bool_]:
    """Tell which chunks, or shards, there are not."""
    grid = _grid(array)
    absent = [array.metadata.encode_chunk_key(place) not in files for place in np.ndindex(grid)]
    return np.array(absent).reshape(grid)


def _check_lengths(array: Any, files: dict[str, Path], file: str) -> None:
    """Compare what chunks hold with their voxels; those in shards, and zstd's that do not say it, are passed over."""
    codecs = array.compressors[-1:] if not array.shards else ()
    packing = next((str(getattr(codec, "codec_id", type(codec).__name__)) for codec in codecs), "")
    most = 2 * math.prod(array.chunks) * array.dtype.itemsize + 2**16
    for key in (key for key in files if Path(key).name not in (*DOCUMENTS, ".zattrs")):
        promised = promised_bytes(files[key], packing.removesuffix("Codec").lower(), most, file=file)
        if promised > most:
            found = f"chunk = {promised} bytes and more"
            raise ResourceError(
                "a chunk holds far more than its voxels", file=file, found=found, expected=f"{most} bytes"
            )


def _are_fill(voxels: NDArray[Any], missing: NDArray[np.bool_], chunks: tuple[int, ...], fill: Any) -> bool:
    """Tell whether the voxels beside the missing chunks are mostly of the fill value, as theirs were then."""
    other = np.zeros(missing.shape, np.int64)
    area = np.zeros(missing.shape, np.int64)
    for axis in range(voxels.ndim):
        cuts = np.arange(chunks[axis], voxels.shape[axis], chunks[axis])
        lower, upper = _ends(axis, slice(None, -1)), _ends(axis, slice(1, None))
        for own, neighbor, planes in ((upper, lower, cuts - 1), (lower, upper, cuts)):
            counted = missing[own] & ~missing[neighbor]
            differ = _differs(np.take(voxels, planes, axis), fill)
            other[own] += np.where(counted, _by_chunk(differ, chunks, axis), 0)
            area[own] += np.where(counted, _by_chunk(np.ones_like(differ), chunks, axis), 0)
    return bool((other <= TORN * area).all())


def _ends(axis: int, part: slice) -> tuple[slice, ...]:
    return (*(slice(None),) * axis, part)


def _differs(values: NDArray[Any], fill: Any) -> NDArray[np.bool_]:
    return np.asarray(values != fill if fill == fill else ~np.isnan(values))


def _by_chunk(flags: NDArray[np.bool_], chunks: tuple[int, ...], across: int) -> NDArray[np.int64]:
    """Count flags in each chunk, along all axes but one."""
    counts = flags.astype(np.int64)
    for axis in (axis for axis in range(flags.ndim) if axis != across):
        counts = np.add.reduceat(counts, np.arange(0, flags.shape[axis], chunks[axis]), axis=axis)
    return counts
