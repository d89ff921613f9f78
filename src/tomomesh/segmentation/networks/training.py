"""Train a network on every slice of a study."""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from ...errors import EmptyError
from ...kernels.threads import in_blocks
from ...model.networks import Networks
from ...model.sliced import parts_of
from ...progress import Progress, silent
from ...som.fit import match
from ..signal import pixels_of
from .slices import Slices

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

    from ...isosurface.crossings import Levels
    from ...model.contours import Contours
    from ...model.lattice import Lattice
    from ...model.sliced import Sliced
    from ...settings import NetworkSettings


def train_study(
    mask: Sliced,
    settings: NetworkSettings,
    *,
    layers: Sliced | None = None,
    levels: Levels | None = None,
    pixel_mm: tuple[float, float] = (1.0, 1.0),
    seed: int = 0,
    first: int = 0,
    threads: int = 0,
    progress: Progress = silent,
) -> Networks:
    """Run one self-organising map on each slice of a window (the paper's Fig. 5, 7).

    Slices are the unit of parallel work, and each draws from a generator of its own, so the result does not
    depend on the number of threads. With ``start="neighbor"`` each starts from the one below, one after the other.

    Parameters
    ----------
    mask : (K, J, I) bool array or slices of it
        What is not an array is drawn some slices at a time, and never whole; so are `layers` and `levels`.
    settings : NetworkSettings
    layers : (K, J, I, L) bool array or slices of it, optional
        The layers of a color study that lie in their windows. Eq. 4 has an input x_ijl for each k_ijl that is not 0:
        it is read as a pixel that is presented once for every layer in which it lies in the window, at
        (i, j, l), layers lying as far apart as columns. A neuron's place is its first two coordinates. Outlines have
        no layers, and are presented once.
    levels : Levels, optional
        The gray levels and the window on them: an outline is then shown where they cross its bounds between pixels,
        unless they are those of a mask, or networks are trained one presentation at a time.
    pixel_mm : (float, float)
        Distance of the columns and of the rows: the networks live in millimeters.
    seed : int
    first : int
        Number of the first slice in the study that these are of: a part is then trained as in the whole, unless each
        slice starts from the one below, or ``signal="auto"`` or the number of neurons looks at all of them.
    threads : int
    progress : callable

    Returns
    -------
    Networks
        Slices with fewer pixels than neurons have none. Where the number of neurons follows from the outlines, a
        smaller ring is trained on them, and its curve gets as many neurons as the others.

    Raises
    ------
    EmptyError
        Where no slice has pixels enough.
    """
    slices = Slices.of(mask, layers, levels, settings, pixel_mm, seed, first)
    graph = slices.network
    least = slices.least(graph)
    count, parts, below = mask.shape[0], [], None
    for start, stop in parts_of(mask):
        told = partial(_tell, progress, start, count)
        parts.append(train_some(slices.part(start, stop), graph, least, below, threads=threads, done=told))
        below = parts[-1].last
    return _networks(parts, slices, graph, least)


class Some(NamedTuple):
    """What was trained on some slices, (n, ...), and what the network of the next may start from."""

    codebooks: NDArray[np.float64]
    bridged: NDArray[np.bool_]
    pixels: NDArray[np.int64]
    strays: NDArray[np.int64]
    last: NDArray[np.float64] | None


def train_some(
    slices: Slices, graph: Lattice, least: int, below: NDArray[np.float64] | None = None,
    *, threads: int = 0, done: Callable[[int], None] = lambda count: None,
) -> Some:  # fmt: skip
    """Train the networks of some slices: those of any ranges are those of the whole.

    Parameters
    ----------
    slices : Slices
        A part of a study's.
    graph : Lattice
    least : int
        Inputs that a network needs.
    below : (u, 2) float array, optional
        The network of the slice before the first, where each starts from the one below.
    threads : int
    done : callable
        Told how many slices are done.
    """
    count, followed = slices.mask.shape[0], slices.settings.start == "neighbor"
    codebooks, bridged = np.zeros((count, len(graph), 2)), np.zeros((count, len(graph.edges)), bool)
    pixels, strays = np.zeros(count, np.int64), np.zeros(count, np.int64)

    def work(start: int, stop: int) -> None:
        nonlocal below
        for k in range(start, stop):
            shown = slices.shown(k)
            pixels[k] = len(shown)
            if len(shown) >= least:
                fitted = slices.fitted(k, shown, graph, below)
                below = fitted.codebook if followed and len(fitted.codebook) == len(graph) else None
                codebooks[k], bridged[k] = slices.spaced(fitted, graph)
                strays[k] = (~fitted.kept).sum()

    in_blocks(work, count, block=1, threads=1 if followed else threads, done=done)
    return Some(codebooks, bridged, pixels, strays, below)


def _tell(progress: Progress, start: int, count: int, done: int) -> None:
    progress("networks", start + done, count)


def _networks(parts: list[Some], slices: Slices, graph: Lattice, least: int) -> Networks:
    """Join what was trained on consecutive slices."""
    codebooks, bridged, pixels, strays = (np.concatenate([part[n] for part in parts]) for n in range(4))
    trained = pixels >= least
    if not trained.any():
        raise EmptyError(
            "no slice has pixels enough for a network",
            found=f"at most {pixels.max()} pixels in a slice",
            expected=f"at least {least}" + (", one a neuron" if least == len(graph) else ""),
            hint="a wider window, or fewer --neurons",
        )
    return Networks(
        graph,
        np.flatnonzero(trained).astype(np.int32),
        codebooks[trained],
        bridged[trained],
        slices.outlined,
        pixels[trained],
        strays[trained],
    )


def regions(
    mask: Sliced,
    found: Networks | Contours,
    *,
    pixel_mm: tuple[float, float] = (1.0, 1.0),
    threads: int = 0,
) -> NDArray[np.uint16]:
    """Compare networks with the image: give every window pixel its winner's label (Fig. 5).

    Parameters
    ----------
    mask : (K, J, I) bool array or slices of it
    found : Networks or Contours
        One network a slice, or several.
    pixel_mm : (float, float)
        Distance of the columns and of the rows.
    threads : int

    Returns
    -------
    (K, J, I) uint16 array
        0 outside the window and on slices without a network, else the neuron's number within its slice plus 1,
        counted through the rings of the slice where there are several.
    """
    labels = np.zeros(mask.shape, np.uint16)

    def work(start: int, stop: int) -> None:
        for k in found.slices[start:stop]:
            codebook = found.codebook_on(int(k)) * pixel_mm
            plane = mask[int(k)]
            winners, _ = match(codebook, pixels_of(plane) * pixel_mm)
            labels[k][plane] = winners + 1

    in_blocks(work, len(found.slices), block=1, threads=threads)
    return labels
