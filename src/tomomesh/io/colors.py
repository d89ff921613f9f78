"""Colors, however a file spells and scales them."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from ..model.points import COLORS

if TYPE_CHECKING:
    from collections.abc import Mapping

    from numpy.typing import NDArray

SPELLINGS = (
    COLORS,
    ("r", "g", "b"),
    ("diffuse_red", "diffuse_green", "diffuse_blue"),
    ("colorred", "colorgreen", "colorblue"),
)
"""Names of the three fields, in lower case; the first triple that is whole counts."""


def named_colors(fields: Mapping[str, NDArray[Any]]) -> tuple[list[str], NDArray[np.uint8]] | None:
    """Find the fields that hold colors.

    Returns
    -------
    names : list of str
        The three fields, as they are spelled.
    colors : (n, 3) uint8 array
        Red, green and blue; None in place of both where there are none, or values no color has.
    """
    spelled = {name.lower(): name for name in fields}
    triple = next((triple for triple in SPELLINGS if all(name in spelled for name in triple)), None)
    if triple is None or any(fields[spelled[name]].ndim != 1 for name in triple):
        return None
    names = [spelled[name] for name in triple]
    colors = _bytes(np.stack([fields[name] for name in names], axis=1))
    return None if colors is None else (names, colors)


def _bytes(values: NDArray[Any]) -> NDArray[np.uint8] | None:
    """Scale to 0 to 255: fractions up to 1, bytes, and 16 bits, whichever holds the largest value."""
    if not values.size or values.dtype == np.uint8:
        return values.astype(np.uint8)
    least, most = values.min(), values.max()
    if not (least >= 0 and most <= 65535):  # NaN fails too
        return None
    fractions = values.dtype.kind == "f" and most <= 1
    scale = 255.0 if fractions else 1.0 if most <= 255 else 1 / 257
    return np.rint(values * scale).astype(np.uint8)


def linear(colors: NDArray[np.uint8]) -> NDArray[np.float32]:
    """Return the shares of light, 0 to 1, that 8-bit sRGB colors stand for (IEC 61966-2-1)."""
    shares = np.arange(256) / 255
    light = np.where(shares <= 0.04045, shares / 12.92, ((shares + 0.055) / 1.055) ** 2.4)
    return np.asarray(light.astype(np.float32)[colors])


def packed_colors(packed: NDArray[np.uint32], *, alpha: bool = False) -> dict[str, NDArray[np.uint8]]:
    """Take apart 0xAARRGGBB, one number a point."""
    shifts = dict(zip((*COLORS, "alpha"), (16, 8, 0, 24), strict=True))
    names = (*COLORS, "alpha") if alpha else COLORS
    return {name: (packed >> shifts[name] & 255).astype(np.uint8) for name in names}
