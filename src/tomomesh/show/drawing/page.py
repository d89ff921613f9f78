"""A page of pixels, its panels, and the file that it becomes."""

from __future__ import annotations

import struct
import zlib
from os import PathLike
from pathlib import Path
from typing import IO, TYPE_CHECKING

import numpy as np
from PIL import Image

from ...errors import OutputError
from .letters import HEIGHT, Word, width, write
from .style import DPI, INK, MUTED, dots_of, rgb

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Floats = NDArray[np.float64]

COMPRESSION = 2
"""Of PNG; 1 and 4 make files 6 % larger and 1 % smaller, and 4 takes 1.4 times as long."""
UNIT = np.array([0.0, 0.0, 1.0, 1.0])
MARGIN = 0.09
"""Inches around what a page shows."""


class Page:
    """A white page, on which panels draw; words are written last, so that nothing hides them.

    Parameters
    ----------
    width, height : float
        Inches.
    dpi : float
        Pixels per inch.
    """

    def __init__(self, width: float, height: float, dpi: float = DPI) -> None:
        self.dpi = dpi
        self.pixels = np.full((round(height * dpi), round(width * dpi), 3), 255, np.uint8)
        self.panels: list[Panel] = []
        self.words: list[Word] = []

    def points(self, length: float) -> float:
        """Return points (1/72 inch) in pixels."""
        return dots_of(length, self.dpi)

    def write(
        self, text: str, place: tuple[float, float], *, size: float = 8.5, color: str = INK, align: float = 0.0,
        up: float = 0.0, strong: bool = False, upward: bool = False,
    ) -> Word:  # fmt: skip
        """Write a text at a pixel.

        `align` is the part of its width that lies before the place, and `up` that of a capital's height below it.
        An `upward` text is turned by a quarter, to the left.
        """
        x, y, high = *place, self.points(size)
        before, below = align * width(text, high), up * HEIGHT * high
        x, y = (x + below, y + before) if upward else (x - before, y + below)
        self.words.append(Word(text, x, y, high, color, strong, upward))
        return self.words[-1]

    @property
    def paper(self) -> Panel:
        """The whole page as a panel whose places are its pixels."""
        high, wide, _ = self.pixels.shape
        return Panel(self, np.array([0.0, 0, wide, high]), np.array([0.0, high, wide, 0]))

    def image(self) -> Image.Image:
        """Return what is drawn and written, in color."""
        drawn = Image.fromarray(self.pixels)
        for word in self.words:
            write(drawn, word)
        return drawn

    def _repr_png_(self) -> bytes:
        """Show the page in a notebook."""
        return png(self)


class Panel:
    """A rectangle of a page, with limits of its own.

    Attributes
    ----------
    box : (4,) float array
        Left, top, right and bottom in pixels.
    limits : (4,) float array
        What lies there: left, bottom, right and top.
    """

    def __init__(self, page: Page, box: Floats, limits: Floats = UNIT) -> None:
        self.page, self.box, self.limits = page, box, limits

    @property
    def scale(self) -> float:
        """Pixels a unit, across."""
        return float((self.box[2] - self.box[0]) / abs(self.limits[2] - self.limits[0]))

    def limit(self, left: float, bottom: float, right: float, top: float, *, equal: bool = True) -> None:
        """Set the limits; `equal` makes the panel smaller, around its middle, until both axes have one scale."""
        self.limits = np.array([left, bottom, right, top], np.float64)
        if equal:
            size = np.abs(self.limits[2:] - self.limits[:2])
            half = size * ((self.box[2:] - self.box[:2]) / size).min() / 2
            middle = (self.box[:2] + self.box[2:]) / 2
            self.box = np.round(np.concatenate([middle - half, middle + half]))

    def place(self, points: Floats) -> Floats:
        """Carry (..., 2) points to pixels of the page."""
        share = (np.asarray(points, np.float64) - self.limits[:2]) / (self.limits[2:] - self.limits[:2])
        left, top, right, bottom = self.box
        return np.asarray(np.array([left, bottom]) + share * np.array([right - left, top - bottom]))

    @property
    def pixels(self) -> NDArray[np.uint8]:
        """The pixels of the page that the panel covers; a view."""
        left, top, right, bottom = np.round(self.box).astype(int)
        return self.page.pixels[max(top, 0) : max(bottom, 0), max(left, 0) : max(right, 0)]

    def rule(self, ends: Floats, width: float, color: str) -> None:
        """Draw a level or upright line between two pixels, `width` points wide and sharp."""
        thick = max(round(self.page.points(width)), 1)
        low, high = ends.min(axis=0), ends.max(axis=0)
        first = np.round(np.where(high > low, low, low - thick / 2)).astype(int)
        last = np.where(high > low, np.round(high).astype(int), first + thick)
        first = np.maximum(first, 0)
        self.page.pixels[first[1] : last[1], first[0] : last[0]] = rgb(color)

    def heading(self, title: str, note: str = "") -> None:
        """Title the panel, with a quieter line under the title."""
        left, top = float(self.box[0]), float(self.box[1])
        rise = self.page.points(20 if note else 9)
        self.page.write(title, (left, top - rise), size=10, strong=True)
        if note:
            self.page.write(note, (left, top - self.page.points(7)), size=8, color=MUTED)


def canvas(
    width: float,
    height: float,
    rows: int = 1,
    columns: int = 1,
    *,
    gap: float = 0.12,
    top: float = 0.0,
    head: float = 0.4,
    left: float = 0.0,
    below: float = 0.0,
    right: float = 0.0,
    dpi: float = DPI,
) -> tuple[Page, list[Panel]]:
    """Open a page of the given inches with a grid of panels of one size.

    Inches are left free between columns (`gap`), at the `top` of the page and at its `right` end, and over, at the
    left of and under each panel (`head`, `left`, `below`).
    """
    page = Page(width, height, dpi)
    wide = (width - 2 * MARGIN - right - (columns - 1) * gap) / columns
    high = (height - 2 * MARGIN - top) / rows
    for n in range(rows * columns):
        x, y = MARGIN + (n % columns) * (wide + gap), MARGIN + top + (n // columns) * high
        box = np.array([x + left, y + head, x + wide, y + high - below])
        page.panels.append(Panel(page, np.round(dpi * box)))
    return page, page.panels


def save(page: Page, file: str | PathLike[str] | IO[bytes]) -> None:
    """Write a page as PNG; the same page gives the same bytes.

    Raises
    ------
    OutputError
        Where the file cannot be written.
    """
    try:
        if isinstance(file, str | PathLike):
            Path(file).write_bytes(png(page))
        else:
            file.write(png(page))
    except OSError as error:
        name = str(file) if isinstance(file, str | PathLike) else ""
        raise OutputError("the picture cannot be written", file=name, hint=str(error.strerror)) from error


def png(page: Page) -> bytes:
    """Return a page as a PNG file.

    Its rows are packed as they are: Pillow tries five filters on each, which takes longer than all else that it does
    and saves nothing in drawings.
    """
    pixels = np.asarray(page.image())
    rows = np.zeros((pixels.shape[0], 1 + 3 * pixels.shape[1]), np.uint8)
    rows[:, 1:] = pixels.reshape(len(pixels), -1)
    per_meter = round(page.dpi / 0.0254)
    chunks = (
        (b"IHDR", struct.pack(">2I5B", pixels.shape[1], pixels.shape[0], 8, 2, 0, 0, 0)),  # 8 bits, red green blue
        (b"pHYs", struct.pack(">2IB", per_meter, per_meter, 1)),
        (b"IDAT", zlib.compress(rows.data, COMPRESSION)),
        (b"IEND", b""),
    )
    return b"\x89PNG\r\n\x1a\n" + b"".join(
        struct.pack(">I", len(data)) + name + data + struct.pack(">I", zlib.crc32(name + data)) for name, data in chunks
    )
