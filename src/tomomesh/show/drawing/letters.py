"""Letters: one font at every size, which comes with Pillow, so that all machines write alike."""

from __future__ import annotations

from functools import cache
from typing import TYPE_CHECKING, NamedTuple

from PIL import Image, ImageDraw, ImageFont

if TYPE_CHECKING:
    from collections.abc import Iterator

RAISED, RAISE, SHARE = {"²": "2", "³": "3"}, 0.32, 0.62
"""Letters that the font lacks are written as these: how high, and how large, in parts of the size."""
LIKE = str.maketrans({"µ": "u", "μ": "u", "–": "-", "×": "x"})
BOLD = 0.04
"""Strong letters are written twice, shifted by this part of their size."""
HEIGHT = 0.72
"""Of a capital letter, in parts of the size."""


class Word(NamedTuple):
    """What is written where: the left end of its base line in pixels, its size in pixels, and how it looks."""

    text: str
    x: float
    y: float
    size: float
    color: str
    strong: bool = False
    upward: bool = False

    @property
    def box(self) -> tuple[float, float, float, float]:
        """Left, top, right and bottom of what it covers."""
        wide, high = width(self.text, self.size), HEIGHT * self.size
        if self.upward:
            return self.x - high, self.y - wide, self.x, self.y
        return self.x, self.y - high, self.x + wide, self.y


@cache
def _font(size: float) -> ImageFont.FreeTypeFont | ImageFont.ImageFont:
    return ImageFont.load_default(size)


def width(text: str, size: float) -> float:
    """Return the width of a text in pixels."""
    return sum(_font(high).getlength(part) for part, high, _ in _runs(text, size))


def _runs(text: str, size: float) -> Iterator[tuple[str, float, float]]:
    """Yield the parts of a text that are written alike, their size, and by how much they are raised."""
    plain = ""
    for letter in text.translate(LIKE):
        if letter in RAISED:
            yield plain, size, 0.0
            yield RAISED[letter], SHARE * size, RAISE * size
            plain = ""
        else:
            plain += letter
    yield plain, size, 0.0


def write(image: Image.Image, word: Word) -> None:
    """Write a word on a picture."""
    if word.upward:
        _write_upward(image, word)
    else:
        _write_at(ImageDraw.Draw(image), word, word.x, word.y, word.color)


def _write_at(draw: ImageDraw.ImageDraw, word: Word, x: float, y: float, ink: str | int) -> None:
    for shift in (0.0, BOLD * word.size) if word.strong else (0.0,):
        place = x + shift
        for part, size, up in _runs(word.text, word.size):
            draw.text((place, y - up), part, fill=ink, font=_font(size), anchor="ls")
            place += _font(size).getlength(part)


def _write_upward(image: Image.Image, word: Word) -> None:
    wide, high = int(width(word.text, word.size)) + 4, int(1.6 * word.size) + 2
    flat = Image.new("L", (wide, high))
    _write_at(ImageDraw.Draw(flat), word, 1, word.size + 1, 255)
    turned = flat.transpose(Image.Transpose.ROTATE_90)
    image.paste(word.color, (round(word.x - word.size - 1), round(word.y) - wide + 1), turned)
