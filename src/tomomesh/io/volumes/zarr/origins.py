"""Where the first voxel of an OME-Zarr image lies: as its RFC 4 has it, or as ngff-zarr writes it."""

from __future__ import annotations

import re
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

ITK, NIBABEL = "ITK", "nibabel"
"""The images of which ngff-zarr makes stores, beside plain arrays. Its own reader takes every translation for ITK's."""

WORLD = {ITK: (1, 1, 1), NIBABEL: (-1, -1, 1)}
"""Signs that carry the origins of these images, LPS and RAS, to LPS."""

NGFF_ZARR = "ngff:Image"
"""What ngff-zarr writes under ``@type``; its levels lie in folders that `LEVELS` describes."""

LEVELS = re.compile(r"scale[0-9]+/.+")


@dataclass(frozen=True)
class AlongAxes:
    """An image's axes x, y and z.

    Attributes
    ----------
    rows : (3,) int array
        The patient axis of each.
    signs : (3,) int array
        1 where it runs to the left, to the back or up, else -1.
    offset, finest : (3,) float array
        The translation of a level, and of the finest, in millimeters.
    """

    rows: NDArray[np.int64]
    signs: NDArray[np.int64]
    offset: NDArray[np.float64]
    finest: NDArray[np.float64]


def writer_of(image: Any) -> str:
    """Tell of what kind of image ngff-zarr made a store, from its marks; empty for other writers.

    Parameters
    ----------
    image : dict
        One of `multiscales`.
    """
    paths = [str(level["path"]) for level in image["datasets"]]
    if image.get("@type") != NGFF_ZARR or not all(map(LEVELS.fullmatch, paths)):
        return ""
    systems = image.get("coordinateSystems") or [image]
    bare = any(isinstance(axis, dict) and isinstance(axis.get("orientation"), str) for axis in systems[0]["axes"])
    return NIBABEL if bare or NIBABEL in str(image.get("name", "")) else ITK


def origin_of(along: AlongAxes, writer: str) -> tuple[NDArray[np.float64], tuple[str, ...]]:
    """Return the place of the first voxel, (3,) in LPS millimeters, and a note where the two readings differ.

    By RFC 4 a translation counts along the direction of its axis: x that runs to the right is 5 where the patient's x,
    which runs to the left, is -5. ngff-zarr writes the origin of the image that it was given, in that image's world,
    for all directions; coarser levels begin a part of a voxel further along each axis.
    """
    lettered = _on_patient(along.rows, along.signs * along.offset)
    further = _on_patient(along.rows, along.signs * (along.offset - along.finest))
    habit = along.finest * np.array(WORLD[writer or ITK]) + further
    if np.allclose(lettered, habit, rtol=0, atol=1e-9):
        return lettered, ()
    if not writer:
        return lettered, ("the translation counts along the directions of the axes, as RFC 4 of the format has it",)
    letter = ", ".join(f"{value:g}" for value in lettered)
    return habit, (
        f"the translation is the origin of an image of {writer}, as ngff-zarr writes it whatever the directions are; "
        f"by RFC 4 of the format the first voxel would be at ({letter})",
    )


def _on_patient(rows: NDArray[np.int64], values: NDArray[np.float64]) -> NDArray[np.float64]:
    placed = np.zeros(3)
    placed[rows] = values
    return placed + 0.0
