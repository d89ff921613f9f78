"""Draw the pictures of docs/images anew, from the built-in head: ``python docs/gallery.py``."""

from __future__ import annotations

import tempfile
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from PIL import Image

from tomomesh import SOM, TriMesh, Volume, phantom, reconstruct_labels, reconstruct_large, window
from tomomesh.cli import main
from tomomesh.measure.section import section
from tomomesh.model.lattice import lattice
from tomomesh.show.drawing.marks import fill, lines
from tomomesh.show.drawing.page import Page, canvas
from tomomesh.show.film import film_slice
from tomomesh.show.plane import Plane

if TYPE_CHECKING:
    from numpy.typing import NDArray

IMAGES = Path(__file__).parent / "images"
BOX, PAGE = (900, 660), (1000, 1300)
PAGED = ("06-slices", "12-outlines")
"""Pictures of several pages, of which the first is kept."""
PAINT = ("#c8553d", "#2f7f86", "#8a6fb0", "#c99a2e")
"""Color of each label."""
FILMED = 10
"""Slice of the head on which a network is filmed."""


def draw() -> None:
    """Run the demo and networks on test regions, and keep their pictures in a small form."""
    IMAGES.mkdir(exist_ok=True)
    with tempfile.TemporaryDirectory() as folder:
        demo, triangle, square = (f"{folder}/{name}" for name in ("demo", "triangle", "square"))
        main(["demo", "-o", demo, "--quiet"])
        main(["network", "square", "--network", "hexagonal", "--neurons", "100", "-o", square, "--quiet"])
        main(["network", "triangle", "--paper", "--neurons", "50", "--film", "-o", triangle, "--quiet"])
        figures = [path for source in (square, f"{demo}/figures", triangle) for path in Path(source).glob("*.png")]
        pictures = {path.stem: Image.open(path).convert("RGB") for path in figures}
        (IMAGES / "02-film.gif").write_bytes(Path(triangle, "02-film.gif").read_bytes())
    for name, picture in sorted(pictures.items()):
        if not name.startswith(PAGED) or name in {f"{page}-1" for page in PAGED}:
            keep(picture, name, box=PAGE if name == "06-slices-1" else BOX)
    (IMAGES / "06-film.gif").write_bytes(filmed())
    keep(overview(pictures), "phantom")
    keep(cut_labels().image().convert("RGB"), "shared-walls")
    keep(slabs_of_a_solid().image().convert("RGB"), "slabs")


def cut_labels() -> Page:
    """Cut a ball in four labels where three of them meet: each mesh by itself, and with shared walls."""
    z, y, x = np.indices((32, 32, 32)) - 15.3
    parts = np.where(z**2 + y**2 + x**2 < 24, 4, np.where(x + 0.3 * y < -2, 1, np.where(y - 0.2 * x < 1, 2, 3)))
    volume = Volume.from_stored(parts * (z**2 + y**2 + x**2 < 170), np.eye(4))
    page, axes = canvas(9.0, 4.8, 1, 2)
    for ax, shared in zip(axes, (False, True), strict=True):
        ax.limit(8.0, 9.0, 23.0, 24.0)
        found = reconstruct_labels(volume, shared_walls=shared)
        for (number, surface), color in zip(found.items(), PAINT, strict=True):
            lines(ax, section(surface.mesh, 15.8), color=color, width=6.0 - 1.3 * number)
        told = "both have the same line" if shared else "between neighbors are gaps and overlaps"
        ax.heading("With --shared-walls" if shared else "Each label by itself", f"three around a fourth, cut: {told}")
    return page


def slabs_of_a_solid() -> Page:
    """Cut a solid in slabs: the halo that the middle one sees, the rounds of its net, and the pieces of the mesh."""
    volume, slab = Volume.from_stored((_solid(40) > 0).astype(np.uint8), np.eye(4)), 14
    found = reconstruct_large(volume, slab=slab, select=(1,))
    page, axes = canvas(10.0, 4.8, 1, 2)
    for ax in axes:
        ax.limit(-1.0, -1.0, 40.0, 40.0)
    low, high = slab - 8.5, 2 * slab + 7.5
    fill(axes[0], np.array([[(0, low), (39, low), (39, high), (0, high)]], float), color="#f3e3c3")
    fill(axes[0], np.array([[(0, 13.5), (39, 13.5), (39, 27.5), (0, 27.5)]], float), color="#e5b769")
    for ax in axes:
        for cut in (13.5, 27.5):
            lines(ax, np.array([[(0.0, cut), (39.0, cut)]]), color="#555555", width=1.0, dashed=True)
    for patch, color in zip(found.mesh, PAINT, strict=False):
        upright = TriMesh(patch.vertices[:, [0, 2, 1]], patch.faces[:, ::-1].astype(np.int64))
        for ax in axes:
            lines(ax, section(upright, 19.8), color=color if ax is axes[1] else "#222222", width=2.5)
    axes[0].heading("A slab and its halo", "the middle slab looks at 8 layers of its neighbors")
    axes[1].heading("Pieces of the mesh", "each slab has its own; they share the vertices of their seams")
    return page


def _solid(side: int) -> NDArray[np.float64]:
    """Return levels over 0 in a solid with a bay."""
    z, y, x = (axis - (side - 1) / 2 for axis in np.ogrid[:side, :side, :side])
    bay = np.sqrt((x - 12) ** 2 + y**2 + (0.6 * z) ** 2) - 6
    return np.asarray(np.minimum(17 - np.sqrt(x**2 + y**2 + z**2), bay))


def filmed() -> bytes:
    """Train a ring on a slice of the head from a random start, looking on."""
    head = phantom()
    mask = window(head.volume, lower=head.lower, upper=head.upper)[FILMED]
    spacing_mm = head.volume.spacing_mm[:2]
    pixels = np.argwhere(mask)[:, ::-1] * spacing_mm
    codebooks = [pixels[np.random.default_rng(0).integers(len(pixels), size=58)]]
    ring = SOM(58, topology="ring", start=codebooks[0], epochs=12, pixel_area=spacing_mm[0] * spacing_mm[1])
    ring.set_params(callback=lambda codebook, epoch: codebooks.append(codebook)).fit(pixels)
    notes = [f"ring of 58 neurons, {epoch} of 12 epochs" for epoch in range(13)]
    places = [codebook / spacing_mm for codebook in codebooks]
    return film_slice(mask, places, lattice("ring", 58), Plane(spacing_mm), notes=notes)


def keep(picture: Image.Image, name: str, *, box: tuple[int, int] = BOX) -> None:
    """Write a picture with few pixels, and five bits a color."""
    small = picture.copy()
    small.thumbnail(box, Image.Resampling.LANCZOS)
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
