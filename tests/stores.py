"""Stores of OME-Zarr and their metadata, as tests write them."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
import pytest

from studies import sampled

if TYPE_CHECKING:
    from pathlib import Path

    from numpy.typing import NDArray

zarr = pytest.importorskip("zarr", reason="the package zarr is not installed")

SCALE, OFFSET = (0.5, 0.7, 2.0), (-3.0, 11.0, 40.0)
AFFINE = np.array([[0.5, 0, 0, -3], [0, 0.7, 0, 11], [0, 0, 2, 40], [0, 0, 0, 1]])
STORED = sampled(AFFINE)
FORMATS = pytest.mark.parametrize("zarr_format", [2, 3])


def multiscales(names: str = "zyx", unit: str | None = "millimeter", per_mm: float = 1.0, **more: Any) -> Any:
    """Return the metadata of an image of one level at path 0."""
    kinds = {"t": "time", "c": "channel"}
    axes: list[dict[str, Any]] = [{"name": name, "type": kinds.get(name, "space")} for name in names]
    for axis in axes if unit else ():
        axis |= {"unit": unit} if axis["type"] == "space" else {}
    steps = [
        {"type": kind, kind: [values["xyz".index(n)] * per_mm if n in "xyz" else other for n in names]}
        for kind, values, other in (("scale", SCALE, 1.0), ("translation", OFFSET, 0.0))
    ]
    return [{"axes": axes, "datasets": [{"path": "0", "coordinateTransformations": steps}], **more}]


def directed(
    z: str = "inferior-to-superior",
    y: str = "posterior-to-anterior",
    x: str = "left-to-right",
    *,
    bare: bool = False,
    unit: str | None = "millimeter",
) -> Any:
    """Return the metadata of an image whose axes have directions, as objects or as ngff-zarr's bare words."""
    images = multiscales(unit=unit)
    for axis, value in zip(images[0]["axes"], (z, y, x), strict=True):
        axis["orientation"] = value if bare else {"type": "anatomical", "value": value}
    return images


def write(folder: Path, stored: NDArray[Any] = STORED, images: Any = None, zarr_format: int = 3, **array: Any) -> Path:
    """Write an image by zarr-python; 0.4 is of format 2, 0.5 of format 3."""
    group = zarr.open_group(folder, mode="w", zarr_format=zarr_format)
    told = {"multiscales": multiscales() if images is None else images}
    group.attrs.update({"ome": {"version": "0.5", **told}} if zarr_format == 3 else told)
    options = {"chunks": tuple(min(size, 4) for size in stored.shape)} | array
    group.create_array("0", shape=stored.shape, dtype=stored.dtype, **options)[...] = stored
    return folder


def chunk(folder: Path, place: str = "1/1/1") -> Path:
    """Return the file of a chunk, whatever the format is."""
    found = [folder / "0" / "c" / place, folder / "0" / place.replace("/", ".")]
    return next(path for path in found if path.exists())
