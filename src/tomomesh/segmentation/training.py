"""Train a network on every slice of a study."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from ..errors import EmptyError
from ..kernels.som.neighborhoods import GAUSSIAN
from ..kernels.threads import in_blocks
from ..measure.polygon import side_lengths
from ..model.lattice import lattice
from ..model.networks import Networks
from ..progress import Progress, silent
from ..som.even_spacing import bridged_edges, even_spacing
from ..som.fit import fit, match, radii, shape_of
from ..som.shrinking import unshrunk
from .contours.curved import evened
from .signal import fills_most, outline, pixels_of

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from ..model.contours import Contours
    from ..model.lattice import Lattice
    from ..settings import NetworkSettings
    from ..som.fit import Fitted

NEAR = 2.0
"""First radius, hops, where a network starts from the result of the slice below. Measured: a ring that starts from its
neighbor's place needs 3 epochs from there, and a start at 4 fails on two-sided walls."""


def train_study(
    mask: NDArray[np.bool_],
    settings: NetworkSettings,
    *,
    layers: NDArray[np.bool_] | None = None,
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
    mask : (K, J, I) bool array
    settings : NetworkSettings
    layers : (K, J, I, L) bool array, optional
        The layers of a color study that lie in their windows. Eq. 4 has an input x_ijl for each k_ijl that is not 0:
        it is read as a pixel that is presented once for every layer in which it lies in the window, at
        (i, j, l), layers lying as far apart as columns. A neuron's place is its first two coordinates. Outlines have
        no layers, and are presented once.
    pixel_mm : (float, float)
        Distance of the columns and of the rows: the networks live in millimeters.
    seed : int
    first : int
        Number of the first slice in the study that these are of: a part is then trained as in the whole, unless each
        slice starts from the one below, or ``signal="auto"`` looks at all of them.
    threads : int
    progress : callable

    Returns
    -------
    Networks
        Slices with fewer pixels than neurons have none.

    Raises
    ------
    EmptyError
        Where no slice has pixels enough.
    """
    graph = lattice(settings.network, settings.neuron_count)
    solid = settings.signal == "auto" and graph.name != "grid" and fills_most(mask)
    outlined = settings.signal == "boundary" or solid
    count = len(mask)
    codebooks, bridged = np.zeros((count, len(graph), 2)), np.zeros((count, len(graph.edges)), bool)
    pixels, strays = np.zeros(count, np.int64), np.zeros(count, np.int64)
    followed = settings.start == "neighbor"
    below: NDArray[np.float64] | None = None

    def work(start: int, stop: int) -> None:
        nonlocal below
        for k in range(start, stop):
            plane = mask[k] if outlined or layers is None else layers[k]
            shown = _shown(plane, pixel_mm, outlined=outlined)
            pixels[k] = len(shown)
            if len(shown) >= len(graph):
                fitted = _fitted(shown, graph, settings, np.random.default_rng([seed, first + k]), pixel_mm, below)
                below = fitted.codebook if followed else None
                codebooks[k], bridged[k] = _spaced(fitted, graph, settings, pixel_mm)
                strays[k] = (~fitted.kept).sum()

    workers = 1 if followed else threads
    in_blocks(work, count, block=1, threads=workers, done=lambda done: progress("networks", done, count))
    trained = pixels >= len(graph)
    if not trained.any():
        raise EmptyError(
            "no slice has pixels enough for a network",
            found=f"at most {pixels.max()} pixels in a slice",
            expected=f"at least {len(graph)}, one a neuron",
            hint="a wider window, or fewer --neurons",
        )
    slices = np.flatnonzero(trained).astype(np.int32)
    return Networks(
        graph,
        slices,
        codebooks[trained],
        bridged[trained],
        outlined,
        pixels[trained],
        strays[trained],
    )


def _shown(plane: NDArray[np.bool_], pixel_mm: tuple[float, float], *, outlined: bool) -> NDArray[np.float64]:
    """Return what the network of a slice sees, in millimeters."""
    shown = outline(plane) if outlined else pixels_of(plane)
    return shown * (*pixel_mm, pixel_mm[0])[: shown.shape[1]]


def _fitted(
    shown: NDArray[np.float64], graph: Lattice, settings: NetworkSettings, rng: np.random.Generator,
    pixel_mm: tuple[float, float], below: NDArray[np.float64] | None,
) -> Fitted:  # fmt: skip
    """Train the network of a slice; one that follows another has its own place near the other's."""
    pixel_area = pixel_mm[0] * pixel_mm[1]
    if below is not None and settings.radius is None:
        _, last = radii(shown, graph, settings, pixel_area)
        settings = replace(settings, radius=(max(NEAR, last), last))
    return fit(shown, graph, settings, rng, pixel_area=pixel_area, start=below)


def _spaced(
    fitted: Fitted, graph: Lattice, settings: NetworkSettings, pixel_mm: tuple[float, float]
) -> tuple[NDArray[np.float64], NDArray[np.bool_]]:
    """Return the neurons in pixels, and which edges bridge gaps; rings unshrunk, lines evenly spaced if asked for."""
    codebook = np.ascontiguousarray(fitted.codebook[:, :2])
    gaps = bridged_edges(codebook, graph, settings.bridge)
    ring = graph.name == "ring"
    if ring and settings.training == "batch" and shape_of(settings) == GAUSSIAN:
        codebook = unshrunk(codebook, gaps, fitted.radius, _half_width(fitted, gaps, pixel_mm))
    if settings.even:
        codebook, gaps = evened(codebook, gaps) if ring else even_spacing(codebook, graph, gaps)
    return codebook / pixel_mm, gaps


def _half_width(fitted: Fitted, gaps: NDArray[np.bool_], pixel_mm: tuple[float, float]) -> float:
    """Return half the width of the band that the inputs of a ring fill: their area over the ring's length."""
    length = float(side_lengths(fitted.codebook[:, :2])[~gaps].sum())
    return float(fitted.kept.sum()) * pixel_mm[0] * pixel_mm[1] / (2 * max(length, 1e-300))


def regions(
    mask: NDArray[np.bool_],
    found: Networks | Contours,
    *,
    pixel_mm: tuple[float, float] = (1.0, 1.0),
    threads: int = 0,
) -> NDArray[np.uint16]:
    """Compare networks with the image: give every window pixel its winner's label (Fig. 5).

    Parameters
    ----------
    mask : (K, J, I) bool array
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
            by_axis = np.ascontiguousarray((pixels_of(mask[k]) * pixel_mm).T)
            winners, _ = match(np.ascontiguousarray(codebook.T), by_axis)
            labels[k][mask[k]] = winners + 1

    in_blocks(work, len(found.slices), block=1, threads=threads)
    return labels
