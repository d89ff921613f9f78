"""Draw the pictures of docs/images anew, from the built-in head: ``python docs/gallery.py``."""

from __future__ import annotations

import tempfile
from pathlib import Path

from PIL import Image

from tomomesh.cli import main

IMAGES = Path(__file__).parent / "images"
BOX = (900, 660)


def draw() -> None:
    """Run the demo and the paper's triangle, and keep their pictures in a small form."""
    IMAGES.mkdir(exist_ok=True)
    with tempfile.TemporaryDirectory() as folder:
        demo, triangle = f"{folder}/demo", f"{folder}/triangle"
        main(["demo", "-o", demo, "--quiet"])
        main(["network", "triangle", "--paper", "--neurons", "50", "-o", triangle, "--quiet"])
        figures = sorted([*Path(demo, "figures").glob("*.png"), *Path(triangle).glob("*.png")])
        pictures = {path.stem: Image.open(path).convert("RGB") for path in figures}
    for name, picture in pictures.items():
        keep(picture, name)
    keep(overview(pictures), "phantom")


def keep(picture: Image.Image, name: str) -> None:
    """Write a picture with few pixels, and five bits a color."""
    small = picture.copy()
    small.thumbnail(BOX, Image.Resampling.LANCZOS)
    small.point([min(round(level / 8) * 8, 255) for level in range(256)] * 3).save(
        IMAGES / f"{name}.png", optimize=True
    )


def overview(pictures: dict[str, Image.Image]) -> Image.Image:
    """Compose one slice's way above three views of the surface."""
    width = pictures["05-regions"].width
    above = pictures["05-regions"]
    below = [_fitted(pictures[name], width // 3) for name in ("07-points", "09-wireframe", "10-shaded")]
    whole = Image.new("RGB", (width, above.height + 40 + max(view.height for view in below)), "white")
    whole.paste(above, (0, 0))
    for n, view in enumerate(below):
        whole.paste(view, (n * width // 3, above.height + 40))
    return whole


def _fitted(picture: Image.Image, width: int) -> Image.Image:
    return picture.resize((width, round(picture.height * width / picture.width)), Image.Resampling.LANCZOS)


if __name__ == "__main__":
    draw()
