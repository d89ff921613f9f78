"""Units of length in millimeters, and what the writers of files call them."""

from __future__ import annotations

import re

MM = {
    "pm": 1e-9, "angstrom": 1e-7, "nm": 1e-6, "um": 1e-3, "mm": 1.0, "cm": 10.0, "dm": 100.0, "m": 1e3, "km": 1e6,
    "thou": 0.0254, "in": 25.4, "ft": 304.8, "us-ft": 1.2e6 / 3937, "yd": 914.4,
}  # fmt: skip
"""Millimeters in a unit, by the name that it has here; a US survey foot is 1200/3937 m (NIST SP 811, B.6)."""

SPELLED = {
    "picometer": "pm", "ångström": "angstrom", "å": "angstrom", "A": "angstrom", "nanometer": "nm",
    "micrometer": "um", "µm": "um", "micron": "um", "µ": "um", "millimeter": "mm", "centimeter": "cm",
    "decimeter": "dm", "meter": "m", "kilometer": "km", "inch": "in", "inches": "in", '"': "in", "foot": "ft",
    "feet": "ft", "ftus": "us-ft", "mil": "thou", "yard": "yd",
}  # fmt: skip
"""What else a unit is called: singular, in small letters, with American spelling and the micro sign."""

ESCAPED = re.compile(r"\\u([0-9a-fA-F]{4})")
"""A letter beyond ASCII, as ImageJ writes it into the text of a TIFF file."""

SHORTEST_WORD = 3
"""Letters from which on a final s means nothing: ms are no m."""

OTHERS = ("Mm", "Pm")
"""Where capitals mean another unit, of which no voxel is made; elsewhere people write them as they like."""

AROUND = " \t\0.^()[]"
"""What stands around a unit without a meaning."""


def unit_named(word: str) -> str | None:
    r"""Return the key of `MM` for a unit as a file has it, None for what is no unit of length.

    Parameters
    ----------
    word : str
        In the singular or the plural, a sign, or ImageJ's escape of one.

    Examples
    --------
    >>> [unit_named(word) for word in ("Microns", r"\u00B5m", "in", "pixel")]
    ['um', 'um', 'in', None]
    """
    told = ESCAPED.sub(lambda found: chr(int(found[1], 16)), word).strip(AROUND)
    told = told.replace("\u03bc", "\u00b5").replace("\u212b", "\u00c5")  # Greek mu; the sign of the Angstrom
    told = told.replace("\u00c2\u00b5", "\u00b5")  # bytes of UTF-8 that were taken for Latin letters
    plain = told if told in OTHERS else told.lower().replace("metre", "meter")
    singular = plain[:-1] if len(plain) > SHORTEST_WORD and plain.endswith("s") else plain
    found = (SPELLED.get(one, one) for one in (told, plain, singular))
    return next((name for name in found if name in MM), None)


def millimeters(word: str) -> float | None:
    """Return the millimeters in a unit as a file has it, None for what is no unit of length."""
    name = unit_named(word)
    return None if name is None else MM[name]
