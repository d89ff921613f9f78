"""Packages that only some formats need."""

from __future__ import annotations

from importlib import import_module
from typing import Any

from ...errors import FormatError

EXTRAS = {
    "tifffile": "tiff", "imagecodecs": "tiff", "zarr": "zarr",
    "laspy": "clouds", "lazrs": "clouds", "pye57": "clouds", "pypcd4": "clouds",
    "pyproj": "clouds", "DracoPy": "neuroglancer", "pyfqmr": "neuroglancer",
}  # fmt: skip
"""Package to the extra that brings it."""


def required(package: str, *, file: str) -> Any:
    """Return a package that reads a kind of file, imported on first use.

    Raises
    ------
    FormatError
        Where it is not installed; it names the package and the extra that brings it.
    """
    try:
        return import_module(package)
    except ImportError:
        raise FormatError(
            f"this kind of file needs the package {package}",
            file=file,
            found=f"{package} = not installed",
            hint=f'pip install "tomomesh[{EXTRAS[package]}]"',
        ) from None
