"""Pictures as they stand in the file: smaller, within a budget, each with what it shows."""

from __future__ import annotations

import base64
import io
from dataclasses import dataclass
from typing import TYPE_CHECKING

from PIL import Image, features

if TYPE_CHECKING:
    from collections.abc import Mapping

BUDGET = 1_500_000
"""Bytes of all pictures. Chosen: they grow by a third as text, and three.js takes 640 KB of the 3 MB of a file that is
sent by mail; the demonstration's take half of it. Twice of it is too large for that; half leaves slices out."""
WIDEST = 1300
"""Pixels of a picture's width: a page of 1280 shows them all."""
QUALITY = 75
"""Of WebP, Pillow's own default 80: 50 blurs thin lines, 90 doubles the file."""
EFFORT = 2
"""Of WebP, 0 to 6: 0 leaves a fifth more bytes in four fifths of the time, 4 takes 1.6 times as long for a fortieth."""
SHADED = "10-shaded"
"""The picture that stands in for the 3-D view."""
ORDER = ("12", "04", "05", "06", "02", "11", "07", "08", "10", "09", "03")
"""Numbers of the pictures, the most telling first: where the budget ends, the last are left out."""
SHEETS = ("06-slices", "12-outlines")
"""Pictures of many slices."""
SHOWS = {
    "02-film": "The network of one slice while it is trained, over what it sees",
    "03-relief": "The gray levels of one slice as a relief (Fig. 3)",
    "04-window": "One slice, and what the window keeps of it (Fig. 4)",
    "05-regions": "The regions of the neurons on one slice (Fig. 5)",
    "06-network": "The network on one slice (Fig. 6)",
    "06-slices": "The networks on all slices, or evenly chosen ones",
    "07-points": "The points that the surface is made from (Fig. 7)",
    "08-surfaces": "From cubes to the surface (Fig. 8)",
    "09-wireframe": "The triangles of the mesh (Fig. 9)",
    "10-shaded": "The mesh, shaded (Fig. 10)",
    "11-fit": "How the mesh came to rest: speed, acceleration and energy of the fit",
    "12-outlines": "Slices with the outline of the mesh",
}
"""Names of pictures, without the number of their page, and what they show."""


@dataclass(frozen=True)
class Picture:
    """A picture in a page.

    Attributes
    ----------
    name, caption : str
    data : str
        A data URL.
    width, height : int
    """

    name: str
    caption: str
    data: str
    width: int
    height: int

    @property
    def wide(self) -> bool:
        """Whether it shows many slices, and wants the whole width of a page."""
        return self.name.startswith(SHEETS)


def pictures_of(drawn: Mapping[str, bytes]) -> tuple[list[Picture], list[str]]:
    """Make pictures small.

    Parameters
    ----------
    drawn : mapping
        Name, as of `tomomesh.show.gallery.draw_all`, to the bytes of a PNG file.

    Returns
    -------
    list of Picture
        The most telling first, as many as the budget holds.
    list of str
        Names of those that were left out.
    """
    taken, left, spent = list[Picture](), list[str](), 0
    for name in sorted(drawn, key=_rank):
        if spent >= BUDGET:
            left.append(name)
            continue
        made, size = smaller(name, drawn[name])
        if spent + size > BUDGET and taken:
            left.append(name)
            continue
        spent += size
        taken.append(made)
    return taken, left


def _rank(name: str) -> tuple[int, str]:
    number = name.partition("-")[0]
    return ORDER.index(number) if number in ORDER else len(ORDER), name


def smaller(name: str, png: bytes) -> tuple[Picture, int]:
    """Return a picture in fewer bytes, and their number."""
    image = Image.open(io.BytesIO(png)).convert("RGB")
    if image.width > WIDEST:
        image = image.resize((WIDEST, round(image.height * WIDEST / image.width)), Image.Resampling.LANCZOS)
    file = io.BytesIO()
    kind = "webp" if features.check("webp") else "png"
    image.save(file, kind, **({"quality": QUALITY, "method": EFFORT} if kind == "webp" else {"optimize": True}))
    data = f"data:image/{kind};base64,{base64.b64encode(file.getvalue()).decode()}"
    return Picture(name, caption_of(name), data, image.width, image.height), len(file.getvalue())


def caption_of(name: str) -> str:
    """Say what a picture shows, and which page it is."""
    kind = "-".join(name.split("-")[:2])
    page = name[len(kind) :].strip("-")
    return SHOWS.get(kind, name) + (f" ({page})" if page else "")
