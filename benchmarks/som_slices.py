"""How far does a ring of 80 lie from the true line of slices that are made: ``python som_slices.py [SEEDS]``."""

from __future__ import annotations

import sys
from itertools import groupby
from typing import TYPE_CHECKING, Any

import numpy as np

from bench import at_most, header, holds, judge, note
from tomomesh.measure.contour import measure_contour
from tomomesh.model.lattice import lattice
from tomomesh.settings import NetworkSettings
from tomomesh.som.even_spacing import bridged_edges
from tomomesh.som.fit import fit

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Floats = NDArray[np.float64]

SEEDS, NEURONS = 100, 80
LOWER, UPPER = 200, 500
RING = lattice("ring", NEURONS)
STARTS = ("random", "ellipse")
ONLINE = {"training": "online", "iterations": 10_000, "trim": 0.0}
"""The paper's training alone: the trimmed re-fit is a batch."""


def main() -> None:
    seeds = range(int(sys.argv[1]) if len(sys.argv) > 1 else SEEDS)
    band = judge("band")
    header(f"Rings of {NEURONS} against the true line, means over {len(seeds)} seeds")
    plain = [pixels(band, seed) for seed in seeds]
    for start in STARTS:
        lies(band, plain, "band", f"online, {start} start", 0.21, start=start, **ONLINE)
        lies(band, plain, "band", f"batch, {start} start", 0.07, start=start)
    lies(band, plain, "band", "batch of 3 epochs, no re-fit", 0.07, epochs=3, trim=0.0)
    strays = [pixels(band, seed, strays=0.05) for seed in seeds]
    for start in STARTS:
        lies(band, strays, "band", f"5 % strays, {start} start", 0.1, start=start)
    bean = [pixels(band, seed, "bean") for seed in seeds]
    gap = [pixels(band, seed, "gap") for seed in seeds]
    for start in STARTS:
        lies(band, bean, "bean", f"bean, {start} start", 0.15, start=start)
        lies(band, gap, "gap", f"gap, {start} start, elsewhere", 0.1, start=start)
    for training in ("online", "batch"):
        for shape in ("bubble", "gaussian", "lateral"):
            kind = ONLINE if training == "online" else {}
            tell(f"{training}, {shape}, random start", band, plain, start="random", neighborhood=shape, **kind)


def pixels(band: Any, seed: int, shape: str = "band", strays: float = 0.0) -> Floats:
    """Return the window's pixels (row, column) of one slice."""
    image = band.slice_image(shape, strays=strays, seed=seed)
    return np.argwhere((image > LOWER) & (image <= UPPER)).astype(np.float64)


def rings(inputs: list[Floats], **chosen: Any) -> list[Floats]:
    settings = NetworkSettings(neurons=NEURONS, **chosen)
    return [fit(shown, RING, settings, np.random.default_rng(seed)).codebook for seed, shown in enumerate(inputs)]


def lies(band: Any, inputs: list[Floats], shape: str, figure: str, mark: float, **chosen: Any) -> None:
    """Compare the mean distance with its mark, and the coverage; count tangles and bridged gaps."""
    found = rings(inputs, **chosen)
    off = [band.distances(ring, shape)[away_from_gap(ring, shape)].mean() for ring in found]
    at_most(f"{figure}: mean distance to the line", float(np.mean(off)), mark, "px")
    note(f"{figure}: largest of a seed", f"{max(off):.3g} px")
    covered = np.mean([band.coverage(ring, shape).mean() for ring in found])
    note(f"{figure}: mean distance from the line to the nearest neuron", f"{covered:.3g} px")
    holds(f"{figure}: no side crosses another in any seed", not tangles(found))
    if shape == "gap":
        holds(f"{figure}: bridged, one gap in every seed", {gaps(ring) for ring in found} == {1})


def tell(figure: str, band: Any, inputs: list[Floats], **chosen: Any) -> None:
    """Print the mean distance without a mark."""
    found = rings(inputs, **chosen)
    off = np.mean([band.distances(ring, "band").mean() for ring in found])
    note(f"{figure}: mean distance to the line", f"{off:.3g} px, {tangles(found)} of {len(found)} tangled")


def tangles(found: list[Floats]) -> int:
    return sum(measure_contour(ring).self_crossings > 0 for ring in found)


def away_from_gap(ring: Floats, shape: str) -> NDArray[np.bool_]:
    """Leave out the neurons within the 60 degrees that the gap takes."""
    angle = np.arctan2(*(ring - 127.5).T)
    return np.asarray(np.abs(angle) > np.pi / 6) if shape == "gap" else np.ones(len(ring), bool)


def gaps(ring: Floats) -> int:
    """Count the runs of bridged edges: a neuron may rest in the middle of a gap."""
    bridged = bridged_edges(ring, RING, NetworkSettings().bridge)
    turned = np.roll(bridged, -int(np.argmin(bridged)))
    return sum(key for key, _ in groupby(turned.tolist()))


if __name__ == "__main__":
    main()
