"""One Zarr array of a local folder: which chunks are there, and whether they hold what they should.

zarr-python takes a chunk that is missing for the fill value, which is right where the writer left it out and wrong
where it was lost; blosc unpacks a chunk that is cut off by some bytes; links are followed, and a filter of pickled
objects would be run. Hence the guards in front of it.
"""

from __future__ import annotations

import json
import math
from dataclasses import dataclass
from itertools import product
from typing import TYPE_CHECKING, Any

import numpy as np

from ....errors import FormatError, ResourceError, UnreadableError
from ....model.lazy import LazyVoxels
from ...files.detached import beside
from ...files.extras import required
from ...files.limits import require_memory
from ...files.parts import Seen, read_later
from ...files.source import third_party, whole
from ..gray import native
from .missing import are_fill, grid_of, missing_chunks, unit_of
from .packed_chunk import promised_bytes

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path

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
        store = zarr.storage.LocalStore(folder.absolute(), read_only=True)
        array = zarr.open_array(store, mode="r", zarr_format=version)
        least = array.chunks if read_later() else tuple(map(max, array.shape, unit_of(array)))
    require_memory(math.prod(least) * array.dtype.itemsize, file=file)
    if 0 in array.shape or math.prod(grid_of(array)) > MOST_CHUNKS:
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


@dataclass(frozen=True, eq=False)
class Chunks:
    """An array in chunks, each of which is checked before it is read.

    Attributes
    ----------
    array : zarr.Array
        It holds the path of its folder, and no file open.
    folder : Path
    document : Seen
        What describes it.
    missing : bool array
        The chunks, or shards, that were not there when it was opened.
    file : str
        The path as the user typed it.
    """

    array: Any
    folder: Path
    document: Seen
    missing: NDArray[np.bool_]
    file: str

    @property
    def shape(self) -> tuple[int, ...]:
        """Sizes of all axes, and one of 1 behind them."""
        return (*self.array.shape, 1)

    @property
    def dtype(self) -> np.dtype[Any]:
        """Of the numbers."""
        dtype: np.dtype[Any] = self.array.dtype
        return dtype

    @property
    def chunks(self) -> tuple[int, ...]:
        """Sizes of the chunks; in shards, of those inside."""
        return (*self.array.chunks, 1)

    def read(self, box: tuple[slice, ...]) -> NDArray[Any]:
        """Return a part.

        Raises
        ------
        FormatError, UnreadableError, ResourceError
            For chunks that are damaged, or gone since the array was opened.
        """
        self.document.unchanged()
        for key in self._keys(box):
            self._check_length(key)
        with third_party("zarr", self.file):
            return np.asarray(self.array[box[:-1]])[..., None]

    def _keys(self, box: tuple[slice, ...]) -> Iterator[str]:
        """Return the keys of the chunks in a box, but for those that were not there."""
        sides = zip(box, self.array.shape, unit_of(self.array), strict=False)
        touched = [np.unique(np.arange(size)[side] // unit).tolist() for side, size, unit in sides]
        for place in product(*touched):
            if not self.missing[place]:
                yield self.array.metadata.encode_chunk_key(place)

    def _check_length(self, key: str) -> None:
        """Compare what a chunk holds with its voxels; shards, and zstd's that do not say it, are passed over."""
        if not (self.folder / key).is_file():
            found, hint = f"chunk = {key}", "the same command again, once nothing writes to the folder"
            raise UnreadableError("a chunk is gone since the array was opened", file=self.file, found=found, hint=hint)
        codecs = self.array.compressors[-1:] if not self.array.shards else ()
        packing = next((str(getattr(codec, "codec_id", type(codec).__name__)) for codec in codecs), "")
        most = 2 * math.prod(self.array.chunks) * self.array.dtype.itemsize + 2**16
        packing = packing.removesuffix("Codec").lower()
        promised = promised_bytes(self.folder / key, packing, most, file=self.file)
        if promised > most:
            found = f"chunk = {promised} bytes and more"
            raise ResourceError(
                "a chunk holds far more than its voxels", file=self.file, found=found, expected=f"{most} bytes"
            )


def read_array(array: Any, folder: Path, *, fill_chunks: bool, file: str) -> tuple[Any, tuple[str, ...]]:
    """Read all voxels, or leave them where they are, and say how many chunks there are not.

    Parameters
    ----------
    array : zarr.Array
        Of `open_array`.
    folder : Path
        Where it lies.
    fill_chunks : bool
        Whether missing chunks are taken for the fill value whatever lies beside them.

    Returns
    -------
    voxels : array or LazyVoxels
        With an axis of 1 behind those of the array.
    notes : tuple of str

    Raises
    ------
    FormatError
        For damaged chunks, and for missing ones that were not left out because they hold the fill value.
    """
    missing = missing_chunks(array, folder, file)
    document = next(folder / name for name in DOCUMENTS if (folder / name).exists())
    lazy = LazyVoxels.of(Chunks(array, folder.absolute(), Seen.of(document), missing, file))
    voxels = native(lazy, file=file) if read_later() else native(lazy.read(), file=file)
    if not missing.any():
        return voxels, ()
    fill, told = array.fill_value, f"{int(missing.sum())} of {missing.size}"
    if missing.all() or not (fill_chunks or are_fill(voxels, missing, unit_of(array), fill)):
        raise FormatError(
            "chunks of the array are missing",
            file=file,
            found=f"missing = {told}",
            expected=f"all of them, or gaps among voxels of the fill value {fill}",
            hint="" if missing.all() else f"a fresh copy of the folder, or --fill-chunks, which takes them for {fill}",
        )
    return voxels, (f"chunks that are not in the file, taken for the fill value {fill}: {told}",)
