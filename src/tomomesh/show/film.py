"""A network while it is trained, as an animated GIF."""

from __future__ import annotations

import io
from typing import TYPE_CHECKING, Any

import numpy as np
from PIL import Image

from .camera import Camera
from .drawing.axes import around
from .drawing.marks import dots, lines
from .drawing.page import canvas
from .drawing.style import NETWORK, WHITE
from .plane import PIXELS, Plane, on_paper
from .topologies import flat

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from numpy.typing import NDArray

    from ..model.lattice import Lattice
    from .drawing.page import Page, Panel

    Floats = NDArray[np.float64]

MOST_FRAMES = 120
"""More are thinned out, the first and the last kept."""
FRAME_MS, START_MS, END_MS = 80, 800, 2400
"""How long a frame stands, and the first and the last."""
SIDE = 4.0
"""Inches of a frame."""
ACROSS, SMALL = 3, 2.8
"""Key frames in a row, and inches of each."""
DPI = 100
COLORS = 32
FRONT = Camera()
PALE = (204, 214, 222)


def film(
    region: Floats,
    codebooks: Floats | Sequence[Floats],
    network: Lattice,
    *,
    notes: Sequence[str] | None = None,
    title: str = "A network over a region",
    camera: Camera = FRONT,
) -> bytes:
    """Draw a network over its inputs, codebook after codebook.

    Parameters
    ----------
    region : (n, 2) or (n, 3) float array
        The input signal.
    codebooks : (s, u, 2) or (s, u, 3) float array
        Positions of the neurons, the start first; as `tomomesh.som.snapshots.snapshots` keeps them, or a
        ``callback`` of `tomomesh.SOM`.
    network : Lattice
        Which neurons are neighbors.
    notes : sequence of str, optional
        What is said under the title of each frame; by default its number.
    title : str
    camera : Camera
        How points in space are looked at.

    Returns
    -------
    bytes
        An animated GIF, which goes on for ever; the same input gives the same bytes.
    """
    page, (ax,) = canvas(SIDE, SIDE + 0.25, dpi=DPI)
    seen, places = flat(region, camera), np.stack([flat(one, camera) for one in codebooks])
    ends = np.concatenate([seen, places.reshape(-1, 2)])
    low, high = ends.min(axis=0), ends.max(axis=0)
    margin = 0.04 * float((high - low).max()) or 1.0
    ax.limit(*(low - margin), *(high + margin))
    dots(ax, seen, size=_dot_size(*np.shape(region)), color=PALE)
    around(ax)
    return _encoded(list(_frames(page, ax, places, network, notes, title)))


def film_slice(
    mask: NDArray[np.bool_],
    codebooks: Floats | Sequence[Floats],
    network: Lattice,
    plane: Plane = PIXELS,
    *,
    notes: Sequence[str] | None = None,
    title: str = "A network over its slice",
) -> bytes:
    """Draw a network over the window of its slice, codebook after codebook.

    Parameters
    ----------
    mask : (J, I) bool array
        The window.
    codebooks : (s, u, 2) float array
        Neurons in pixel indices (column, row), the start first.
    network : Lattice
    plane : Plane
        Spacing and sense of the slice.
    notes : sequence of str, optional
        What is said under the title of each frame; by default its number.
    title : str

    Returns
    -------
    bytes
        An animated GIF, as of `film`.
    """
    places = np.stack([plane.place(one) for one in codebooks])
    bounds = plane.bounds(mask, places.reshape(-1, 2))
    ratio = float(np.clip((bounds[1] - bounds[0])[1] / (bounds[1] - bounds[0])[0], 0.4, 1.8))
    page, (ax,) = canvas(SIDE, SIDE * ratio + 0.35, left=0.5, below=0.42, dpi=DPI)
    plane.crop(ax, bounds)
    plane.draw(ax, on_paper(np.asarray(mask, bool), PALE))
    plane.rule([ax])
    return _encoded(list(_frames(page, ax, places, network, notes, title)))


def draw_key_frames(
    mask: NDArray[np.bool_],
    codebooks: Floats | Sequence[Floats],
    edges: NDArray[np.integer[Any]],
    plane: Plane = PIXELS,
    *,
    notes: Sequence[str],
    title: str = "A network over its slice",
) -> Page:
    """Draw some frames as those of `film_slice` beside each other, three in a row.

    Parameters
    ----------
    mask : (J, I) bool array
    codebooks : (s, u, 2) float array
        Of one network, or of several.
    edges : (e, 2) int array
        Which neurons are linked.
    plane : Plane
    notes : sequence of str
        What is said over each.
    title : str
    """
    places = np.stack([plane.place(one) for one in codebooks])
    bounds = plane.bounds(mask, places.reshape(-1, 2))
    ratio = float(np.clip((bounds[1] - bounds[0])[1] / (bounds[1] - bounds[0])[0], 0.4, 1.8))
    rows = -(-len(places) // ACROSS)
    page, axes = canvas(ACROSS * SMALL, rows * (SMALL * ratio + 0.4), rows, ACROSS)
    for n, (ax, neurons) in enumerate(zip(axes, places, strict=False)):
        plane.crop(ax, bounds)
        plane.draw(ax, on_paper(np.asarray(mask, bool), PALE))
        _draw_neurons(ax, neurons, edges)
        ax.heading(title if n == 0 else "", notes[n])
    return page


def _draw_neurons(ax: Panel, neurons: Floats, edges: NDArray[np.integer[Any]]) -> None:
    lines(ax, neurons[edges], color=NETWORK, width=1.1)
    dots(ax, neurons, size=3.7, color=NETWORK, rim=WHITE, width=0.4)


def _dot_size(count: int, dimensions: int) -> float:
    """Let the dots of a filled plane region overlap, which also is shorter to store; keep those in space apart."""
    area = np.clip(1.5e5 / count, 2.0, 36.0) if dimensions == 2 else np.clip(1.5e4 / count, 1.0, 9.0)
    return float(np.sqrt(area))


def _frames(
    page: Page, ax: Panel, places: Floats, network: Lattice, notes: Sequence[str] | None, title: str
) -> Iterator[Image.Image]:
    """Move one network over one background, so that nothing but it changes."""
    chosen = np.unique(np.linspace(0, len(places) - 1, min(len(places), MOST_FRAMES)).round().astype(int))
    background, words = page.pixels.copy(), [*page.words]
    for n in chosen:
        page.pixels[:], page.words = background, [*words]
        _draw_neurons(ax, places[n], network.edges)
        ax.heading(title, notes[n] if notes is not None else f"{n} of {len(places) - 1}")
        yield page.image()


def _encoded(frames: list[Image.Image]) -> bytes:
    """Write frames of one palette, so that what stands still is stored once."""
    palette = frames[len(frames) // 2].quantize(COLORS, method=Image.Quantize.MAXCOVERAGE)
    first, *others = [one.quantize(palette=palette, dither=Image.Dither.NONE) for one in frames]
    shown_ms = [START_MS, *[FRAME_MS] * (len(frames) - 2), END_MS][-len(frames) :]
    file = io.BytesIO()
    first.save(file, format="GIF", save_all=True, append_images=others, duration=shown_ms, loop=0, optimize=False)
    return file.getvalue()
