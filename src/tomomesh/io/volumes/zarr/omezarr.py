"""OME-Zarr images of a local folder, one level of their pyramid; plain Zarr arrays too."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from ....errors import FormatError, UsageError
from ....model.volume import Volume
from ...files.detached import beside
from ...files.source import third_party
from ..affine import GIVEN, required_spacing, upright
from ..raster import gray_or_color, layers_last
from .array import DOCUMENTS, document_of, open_array, read_array
from .omezarr_frame import Axes, axes_of, frame_of
from .origins import writer_of

if TYPE_CHECKING:
    from pathlib import Path

    from numpy.typing import NDArray

    from ....settings import ReadSettings

MARKS = (*DOCUMENTS, ".zgroup", ".zattrs")
"""Files by which a folder of any name is known as Zarr's."""


def is_zarr(folder: Path) -> bool:
    """Tell whether a folder is a Zarr store, or one array of it."""
    return folder.suffix.lower() == ".zarr" or any((folder / mark).exists() for mark in MARKS)


def read_omezarr(folder: Path, settings: ReadSettings) -> Volume:
    """Read an image of OME-Zarr 0.4, 0.5 or 0.6, or an array (K, J, I[, L]), from a folder of Zarr, format 2 or 3.

    Parameters
    ----------
    folder : Path
        That of the image; nothing outside of it is opened.
    settings : ReadSettings
        `level` of the pyramid, 0 the finest; `spacing` stands in for one that the folder does not hold; `fill_chunks`.

    Returns
    -------
    Volume
        In patient millimeters, LPS. Where the axes have no directions, columns run to +x (left), rows to +y
        (posterior), slices to +z (superior).

    Raises
    ------
    FormatError, GeometryError, ResourceError
        As the metadata or the chunks demand.
    UsageError
        For a level that there is not.
    """
    name = str(folder)
    if _is_array(folder, name):
        return _read_plain(folder, settings, name)
    image = _image(folder, name)
    with third_party("the reader of OME metadata", name):
        level = _level(image, settings, name)
        axes = axes_of(image, _system(level), file=name)
        steps, finest = _steps(image, level), _steps(image, image["datasets"][0])
        affine, notes = frame_of(axes, steps, finest, settings, writer=writer_of(image), file=name)
        place = _array_folder(folder, str(level["path"]), name)
    array = open_array(place, file=name)
    _check_shape(array, axes, name)
    stored, more = read_array(array, place, fill_chunks=settings.fill_chunks, file=name)
    return _volume(layers_last(stored, axes.zyx, file=name), affine, notes + more, name)


def _is_array(folder: Path, name: str) -> bool:
    described = document_of(folder, "zarr.json", file=name)
    return described.get("node_type") == "array" or (folder / ".zarray").exists()


def _read_plain(folder: Path, settings: ReadSettings, name: str) -> Volume:
    array = open_array(folder, file=name)
    if array.ndim not in (3, 4):
        expected = "(slices, rows, columns), or colors behind"
        raise FormatError("the array is no volume", file=name, found=f"shape = {array.shape}", expected=expected)
    spacing = required_spacing(settings.spacing, file=name, what="Zarr arrays without OME metadata hold no spacing")
    stored, notes = read_array(array, folder, fill_chunks=settings.fill_chunks, file=name)
    return _volume(layers_last(stored, (0, 1, 2), file=name), upright(spacing), (GIVEN, *notes), name)


def _volume(stored: Any, affine: NDArray[np.float64], notes: tuple[str, ...], name: str) -> Volume:
    voxels, more = gray_or_color(stored, stored.shape[3], file=name)
    return Volume.from_stored(voxels, affine, notes=notes + more)


def _image(folder: Path, name: str) -> Any:
    """Return the metadata of the first image of a folder."""
    with third_party("the reader of OME metadata", name):
        attributes = document_of(folder, "zarr.json", file=name).get("attributes") or {}
        attributes = attributes.get("ome") or document_of(folder, ".zattrs", file=name)
        images = attributes.get("multiscales") or [None]
        if images[0] is not None and {"axes", "coordinateSystems"} & set(images[0]):
            return images[0]
    several = {"bioformats2raw.layout", "plate", "well", "series"} & set(attributes)
    raise FormatError(
        "the folder holds no OME-Zarr image",
        file=name,
        found=f"metadata = {', '.join(sorted(several)) or 'no multiscales with axes'}",
        expected="OME-Zarr 0.4, 0.5 or 0.6",
        hint="the folder of one image inside it, as NAME/0" if several else "the folder of one array, with --spacing",
    )


def _level(image: Any, settings: ReadSettings, name: str) -> Any:
    levels = image["datasets"]
    if settings.level >= len(levels):
        raise UsageError(
            "the image has no such level",
            file=name,
            found=f"--level {settings.level}",
            expected=f"0 to {len(levels) - 1}, 0 being the full resolution",
        )
    return levels[settings.level]


def _steps(image: Any, level: Any) -> list[Any]:
    """Return a level's transformations one by one, then the image's, which in 0.6 lead to other systems."""
    after = () if "coordinateSystems" in image else image.get("coordinateTransformations", ())
    steps = [*level.get("coordinateTransformations", ()), *after]
    return [step for one in steps for step in (one["transformations"] if one["type"] == "sequence" else [one])]


def _system(level: Any) -> str:
    """Return the name of the coordinate system into which 0.6 carries a level."""
    told = [one.get("output", "") for one in level.get("coordinateTransformations", ())]
    output = told[0] if told else ""
    return str(output.get("name", "") if isinstance(output, dict) else output)


def _array_folder(folder: Path, path: str, name: str) -> Path:
    """Return the folder of a level; never one outside of the image's."""
    for document in DOCUMENTS:
        if (folder / path / document).exists():
            return beside(folder / document, f"{path}/{document}").parent
    raise FormatError("a level of the image is missing", file=name, expected="a Zarr array under each level's path")


def _check_shape(array: Any, axes: Axes, name: str) -> None:
    """Refuse several frames, and channels that are no color, before any of them is read."""
    sizes = dict(zip(axes.names, array.shape, strict=False))
    if len(axes.names) != array.ndim:
        found = f"axes = {len(axes.names)}, shape = {array.shape}"
        raise FormatError("the axes of the image contradict its array", file=name, found=found)
    color = sizes.get("c", 1) in (3, 4) and array.dtype == np.uint8
    if sizes.get("t", 1) > 1 or (sizes.get("c", 1) > 1 and not color):
        raise FormatError(
            "the image holds several frames or channels",
            file=name,
            found=f"t = {sizes.get('t', 1)}, c = {sizes.get('c', 1)} of {array.dtype}",
            expected="one of each, or 3 channels of bytes for color",
            hint="one frame and channel, written to a store of its own",
        )
