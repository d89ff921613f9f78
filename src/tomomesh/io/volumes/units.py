"""Millimeters in the units of length that image files name, as their writers spell them."""

from __future__ import annotations

import re

MM = {
    "angstrom": 1e-7, "ångström": 1e-7, "å": 1e-7, "picometer": 1e-9, "pm": 1e-9, "nanometer": 1e-6, "nm": 1e-6,
    "micrometer": 1e-3, "µm": 1e-3, "um": 1e-3, "micron": 1e-3, "millimeter": 1.0, "mm": 1.0, "centimeter": 10.0,
    "cm": 10.0, "decimeter": 100.0, "dm": 100.0, "meter": 1e3, "m": 1e3, "kilometer": 1e6, "km": 1e6, "thou": 0.0254,
    "inch": 25.4, "inches": 25.4, "in": 25.4, '"': 25.4, "foot": 304.8, "feet": 304.8, "ft": 304.8, "yard": 914.4,
    "yd": 914.4,
}  # fmt: skip
"""Singular, in small letters, with American spelling and the micro sign."""

ESCAPED = re.compile(r"\\u([0-9a-fA-F]{4})")
"""A letter beyond ASCII, as ImageJ writes it into the text of a TIFF file."""

SHORTEST_WORD = 3
"""Letters from which on capitals and a final s mean nothing: among shorter ones, Mm is no mm, and the ms no m."""


def millimeters(unit: str) -> float | None:
    r"""Return the millimeters in a unit, None for what is no unit of length.

    Parameters
    ----------
    unit : str
        As a file has it: a word in the singular or the plural, a sign, or ImageJ's escape of one.

    Examples
    --------
    >>> [millimeters(unit) for unit in ("Microns", r"\u00B5m", "in", "pixel")]
    [0.001, 0.001, 25.4, None]
    """
    plain = ESCAPED.sub(lambda found: chr(int(found[1], 16)), unit).strip().strip("\0")
    plain = plain.replace("\u03bc", "\u00b5").replace("\u212b", "\u00c5")  # Greek mu; the sign of the Angstrom
    word = plain.lower() if len(plain) >= SHORTEST_WORD or plain == "\u00c5" else plain
    word = re.sub("metre", "meter", word)
    return MM.get(word, MM.get(word[:-1]) if len(word) > SHORTEST_WORD and word.endswith("s") else None)
