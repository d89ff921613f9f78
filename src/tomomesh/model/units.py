"""Units of length in millimeters, and what the writers of files call them."""

from __future__ import annotations

import re
from decimal import Decimal

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

READABLE = (("km", 1e7), ("m", 1e4), ("mm", 1e-2), ("um", 1e-5), ("nm", 0.0))
"""Units that a person reads, each from so many millimeters on: printers and scanners tell their millimeters from .01 to
10,000."""
READABLE_VOLUMES = (("m^3", 1e9, 1e9), ("cm^3", 1e3, 1.0), ("mm^3", 1.0, 0.0))
"""Units of volume, each of so many cubic millimeters and from so many on."""


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


def plain(value: float, digits: int = 4) -> str:
    """Return a number with so many digits that count, and without an exponent.

    Examples
    --------
    >>> plain(2699123.4, 6), plain(0.00001234, 2), plain(12.0)
    ('2699120', '0.000012', '12')
    """
    return f"{Decimal(f'{value:.{digits}g}'):f}"


def length_in_words(*mm: float, digits: int = 4) -> str:
    """Return lengths in millimeters as a person reads them: in the unit that suits the longest.

    Examples
    --------
    >>> length_in_words(12000.0), length_in_words(0.00208), length_in_words(30.0, 20.5)
    ('12 m', '2.08 um', '30 x 20.5 mm')
    """
    longest = max(mm)
    name = next(name for name, least in READABLE if longest >= least)
    return f"{' x '.join(plain(side / MM[name], digits) for side in mm)} {name}"


def volume_in_words(mm3: float, digits: int = 4) -> str:
    """Return a volume in cubic millimeters in the unit that suits it.

    Examples
    --------
    >>> volume_in_words(8.97e11), volume_in_words(0.003), volume_in_words(502300.0)
    ('897 m^3', '0.003 mm^3', '502.3 cm^3')
    """
    name, unit = next((name, unit) for name, unit, least in READABLE_VOLUMES if abs(mm3) >= least)
    return f"{plain(mm3 / unit, digits)} {name}"
