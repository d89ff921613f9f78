"""PNG, TIFF and JPEG slices in a folder."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from ...errors import FormatError, GeometryError, ResourceError
from ...model.lazy import LazyVoxels
from ...model.volume import Volume
from ...settings import ReadSettings
from ..files.limits import require_memory
from ..files.parts import Seen, read_later
from ..files.source import existing_file, first_bytes, suffix_of, third_party
from .affine import required_spacing, upright
from .gray import WHITE_IS_ZERO, bright_is_high, native, without_holes
from .slice_names import in_order
from .tiff import read_page

if TYPE_CHECKING:
    from pathlib import Path

    from numpy.typing import NDArray


FAMILIES = {".png": "PNG", ".tif": "TIFF", ".tiff": "TIFF", ".jpg": "JPEG", ".jpeg": "JPEG"}
"""Suffixes of slices, and the format behind each."""

CONVERTED_MODES = {"RGB": "RGB", "RGBA": "RGB", "P": "RGB", "1": "L", "LA": "L"}
"""Pillow's modes that are turned into another before they are read; but for TIFF's bits."""

PHOTOMETRIC, BITS, SAMPLE_FORMAT = 262, 258, 339
"""Numbers of TIFF's fields that say which numbers are bright, how many bits one has, and of which kind it is."""

AS_STORED = {("L", 2): np.int8, ("I", 1): np.uint32}
"""Pillow's modes that do not tell whether numbers have a sign, with TIFF's kind of numbers (2 has one), of 32 bits."""

TIFF_MARKS = (b"II*\0", b"MM\0*", b"II+\0", b"MM\0+")
"""First bytes of TIFF files."""

GRAY_MODES = ("L", "I", "F", "I;16", "I;16B", "I;16L")
"""Pillow's modes of one channel."""


def read_images(files: list[Path], settings: ReadSettings, *, folder: str) -> Volume:
    """Stack slices in the order of the numbers in their names.

    Parameters
    ----------
    files : list of Path
        PNG, TIFF or JPEG files, of one kind.
    settings : ReadSettings
        `spacing` must be given: such files hold none.
    folder : str
        The path as the user typed it.

    Returns
    -------
    Volume
        Columns run to +x (left), rows to +y (posterior), slices to +z (superior); the origin is 0.

    Raises
    ------
    FormatError
        For a slice that cannot be read, several pages in a file, or mixed kinds.
    GeometryError
        Without `spacing`, or where the slices differ in size.
    ResourceError
        Where the stack does not fit into the memory.
    """
    kinds = sorted({FAMILIES[suffix_of(path)] for path in files})
    if len(kinds) > 1:
        raise FormatError(
            "the folder holds slices of several kinds",
            file=folder,
            found=" and ".join(kinds),
            expected="one kind",
        )
    spacing = required_spacing(settings.spacing, file=folder, what=f"{kinds[0]} slices hold no spacing")
    ordered, told = in_order(files)
    first, turned = _pixels(ordered[0])
    if read_later():
        seen = tuple(map(Seen.of, ordered))
        stack: Any = LazyVoxels.of(Pictures((len(seen), *first.shape), first.dtype, seen))
    else:
        require_memory(first.nbytes * len(ordered), file=folder)
        stack = np.empty((len(ordered), *first.shape), first.dtype)
        for k, path in enumerate(ordered):
            pixels, more = _pixels(path)
            _check_same_kind(pixels, first, path.name, ordered[0].name)
            stack[k], turned = pixels, turned or more
    voxels, notes = without_holes(native(stack, file=folder), file=folder)
    note = f"{len(ordered)} {kinds[0]} slices in the order of their names: columns left, rows back, slices up"
    return Volume.from_stored(voxels, upright(spacing), notes=(note, *told, *turned, *notes))


@dataclass(frozen=True)
class Pictures:
    """Slices, each in a file of its own.

    Attributes
    ----------
    shape : tuple of int
    dtype : data type
    files : tuple of Seen
    """

    shape: tuple[int, ...]
    dtype: np.dtype[Any]
    files: tuple[Seen, ...]

    @property
    def chunks(self) -> tuple[int, ...]:
        """Sizes of what is read together: a slice."""
        return (1, *self.shape[1:])

    def read(self, box: tuple[slice, ...]) -> NDArray[Any]:
        """Return a part.

        Raises
        ------
        FormatError, UnreadableError, GeometryError
            For slices that are damaged, of another kind than the first, or were written since they were opened.
        """
        return np.stack([self._slice(one)[box[1:]] for one in self.files[box[0]]])

    def _slice(self, seen: Seen) -> NDArray[Any]:
        pixels, _ = _pixels(seen.unchanged())
        first = np.broadcast_to(np.zeros((), self.dtype), self.shape[1:])
        _check_same_kind(pixels, first, seen.path.name, self.files[0].path.name)
        return pixels


def read_picture(path: str | Path) -> Volume:
    """Read one PNG, TIFF or JPEG picture as a slice of pixels of 1 mm.

    Raises
    ------
    UnreadableError, FormatError
        Where it is missing, or no such picture.
    """
    file = existing_file(path)
    if suffix_of(file) not in FAMILIES:
        found = f"suffix = {suffix_of(file) or 'none'}"
        raise FormatError(
            "the picture is of an unknown kind", file=str(path), found=found, expected="PNG, TIFF or JPEG"
        )
    return read_images([file], ReadSettings(spacing=(1.0, 1.0, 1.0)), folder=str(path))


def _pixels(path: Path) -> tuple[NDArray[Any], tuple[str, ...]]:
    """Return one slice, (J, I) or (J, I, 3), and whether its gray levels were turned over."""
    from PIL import Image, UnidentifiedImageError

    with third_party("Pillow", path.name):
        try:
            image = Image.open(path, formats=tuple(set(FAMILIES.values())))
        except Image.DecompressionBombError:
            raise ResourceError("the slice is too large to be read", file=path.name) from None
        except UnidentifiedImageError:
            if first_bytes(path, 4) not in TIFF_MARKS:
                raise
            return read_page(path)  # kinds of numbers that Pillow does not know
        with image:
            require_memory(image.width * image.height * 4, file=path.name)
            if getattr(image, "n_frames", 1) > 1:
                raise FormatError("the file holds several pages", file=path.name, expected="one slice a file")
            image.load()
            mask = image.mode == "1" and image.format == "TIFF"
            convert = image.mode in CONVERTED_MODES and not mask
            pixels = np.asarray(image.convert(CONVERTED_MODES[image.mode]) if convert else image)
            if image.mode not in CONVERTED_MODES and image.mode not in GRAY_MODES:
                raise FormatError(
                    "the slice's colors cannot be read",
                    file=path.name,
                    found=f"mode = {image.mode}",
                    expected="gray or RGB",
                )
            fields = getattr(image, "tag_v2", {})
            bits = fields.get(BITS, (1,))[0] if fields.get(PHOTOMETRIC) == WHITE_IS_ZERO else 0
    if mask:
        return bright_is_high(pixels ^ bool(bits), 1)  # Pillow has turned over what is WhiteIsZero
    kind = AS_STORED.get((image.mode, fields.get(SAMPLE_FORMAT, (1,))[0]))
    if kind and fields.get(BITS) == (8 * np.dtype(kind).itemsize,):
        pixels = pixels.view(kind)
    pixels = native(pixels, file=path.name)
    if bits and pixels.dtype == np.uint8:
        pixels = 255 - pixels  # Pillow has turned them over
    return bright_is_high(pixels.copy() if bits else pixels, min(bits, 8 * pixels.itemsize))


def _check_same_kind(pixels: NDArray[Any], first: NDArray[Any], name: str, first_name: str) -> None:
    if pixels.shape[:2] != first.shape[:2]:
        raise GeometryError(
            f"the slice differs in size from {first_name}",
            file=name,
            found=f"size = {pixels.shape[1]} x {pixels.shape[0]}",
            expected=f"{first.shape[1]} x {first.shape[0]}",
        )
    if pixels.shape != first.shape or pixels.dtype != first.dtype:
        raise FormatError(
            f"the slice is of another kind than {first_name}",
            file=name,
            found=f"pixels = {pixels.dtype}{pixels.shape[2:] or ''}",
            expected=f"{first.dtype}{first.shape[2:] or ''}",
        )
