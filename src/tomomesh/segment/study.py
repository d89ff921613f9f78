"""Train a network on every slice of a study."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from ..errors import EmptyError
from ..kernels.threads import in_blocks
from ..model.lattice import lattice
from ..model.networks import Networks
from ..progress import Progress, silent
from .even import bridged_edges, even_spacing
from .signal import fills_most, outline, pixels_of
from .som.fit import match, radii, train

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from ..model.lattice import Lattice
    from ..settings import NetworkSettings

NEAR = 2.0
"""First radius, hops, where a network starts from the result of the slice below."""


def train_study(
    mask: NDArray[np.bool_],
    settings: NetworkSettings,
    *,
    layers: NDArray[np.bool_] | None = None,
    pixel_mm: tuple[float, float] = (1.0, 1.0),
    seed: int = 0,
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
    seed, threads : int
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
    pixel_area = pixel_mm[0] * pixel_mm[1]
    codebooks, bridged = np.zeros((count, len(graph), 2)), np.zeros((count, len(graph.edges)), bool)
    pixels, strays = np.zeros(count, np.int64), np.zeros(count, np.int64)

    followed = settings.start == "neighbor"
    before: list[NDArray[np.float64]] = []

    def work(start: int, stop: int) -> None:
        for k in range(start, stop):
            plane = mask[k] if outlined or layers is None else layers[k]
            shown = outline(plane) if outlined else pixels_of(plane)
            shown = shown * (*pixel_mm, pixel_mm[0])[: shown.shape[1]]
            pixels[k] = len(shown)
            if len(shown) >= len(graph):
                rng = np.random.default_rng([seed, k])
                chosen = (
                    _from_neighbor(shown, graph, settings, pixel_area, begun=bool(before)) if followed else settings
                )
                found, kept = train(
                    shown, graph, chosen, rng, pixel_area=pixel_area, start=before.pop() if before else None
                )
                before.extend([found] if followed else [])
                found = np.ascontiguousarray(found[:, :2])
                gaps = bridged_edges(found, graph, settings.bridge)
                if settings.even:
                    found, gaps = even_spacing(found, graph, gaps)
                codebooks[k], bridged[k], strays[k] = found / pixel_mm, gaps, (~kept).sum()

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


def _from_neighbor(
    shown: NDArray[np.float64], graph: Lattice, settings: NetworkSettings, pixel_area: float, *, begun: bool
) -> NetworkSettings:
    """Return the settings of a slice that follows another, near whose result its own will be; or of the first."""
    if not begun or settings.radius is not None:
        return settings
    _, last = radii(shown, graph, settings, pixel_area)
    return replace(settings, radius=(max(NEAR, last), last))


def regions(
    mask: NDArray[np.bool_],
    networks: Networks,
    *,
    pixel_mm: tuple[float, float] = (1.0, 1.0),
    threads: int = 0,
) -> NDArray[np.uint16]:
    """Compare the networks with the image: give every window pixel its winner's label (Fig. 5).

    Parameters
    ----------
    mask : (K, J, I) bool array
    networks : Networks
    pixel_mm : (float, float)
        Distance of the columns and of the rows.
    threads : int

    Returns
    -------
    (K, J, I) uint16 array
        0 outside the window and on slices without a network, else the neuron's number within its slice plus 1.
    """
    labels = np.zeros(mask.shape, np.uint16)

    def work(start: int, stop: int) -> None:
        for n in range(start, stop):
            plane = networks.slices[n]
            by_axis = np.ascontiguousarray((pixels_of(mask[plane]) * pixel_mm).T)
            winners, _ = match(np.ascontiguousarray((networks.codebooks[n] * pixel_mm).T), by_axis)
            labels[plane][mask[plane]] = winners + 1

    in_blocks(work, len(networks.slices), block=1, threads=threads)
    return labels
