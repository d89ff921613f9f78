"""Train one network on a test region or on one picture (the paper's Fig. 2)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from ..errors import EmptyError, UsageError
from ..model.lattice import lattice
from .even import bridged_edges, even_spacing
from .som import match, start_positions, train

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from ..model.lattice import Lattice
    from ..settings import NetworkSettings


@dataclass(frozen=True)
class TrainedNetwork:
    """A network over its region.

    Attributes
    ----------
    inputs : (n, d) float array
    lattice : Lattice
    start, codebook : (u, d) float arrays
        Positions of the neurons before and after the training.
    measures : dict
        How well the network lies, lengths in the unit of the inputs.
    """

    inputs: NDArray[np.float64]
    lattice: Lattice
    start: NDArray[np.float64]
    codebook: NDArray[np.float64]
    measures: dict[str, Any]


def train_region(
    inputs: NDArray[np.float64], settings: NetworkSettings, *, seed: int = 0, pixel_area: float = 1.0
) -> TrainedNetwork:
    """Train a network on inputs of any dimension from 2 up.

    Parameters
    ----------
    inputs : (n, d) float array
    settings : NetworkSettings
    seed : int
    pixel_area : float
        Area that one input stands for.

    Returns
    -------
    TrainedNetwork

    Raises
    ------
    UsageError
        For inputs of fewer than two dimensions.
    EmptyError
        With fewer inputs than neurons.
    """
    if inputs.ndim != 2 or inputs.shape[1] < 2:
        raise UsageError("inputs have two numbers each or more", found=f"shape = {inputs.shape}", expected="(n, d)")
    graph = lattice(settings.network, settings.neurons)
    if len(inputs) < len(graph):
        raise EmptyError(
            "the region has fewer inputs than the network has neurons",
            found=f"{len(inputs)} inputs",
            expected=f"at least {len(graph)}",
            hint="a wider window, or fewer --neurons",
        )
    start = start_positions(inputs, graph, settings.start, np.random.default_rng(seed))
    codebook, kept = train(inputs, graph, settings, np.random.default_rng(seed), pixel_area=pixel_area)
    if settings.even:
        codebook, _ = even_spacing(codebook, graph, bridged_edges(codebook, graph, settings.bridge))
    return TrainedNetwork(inputs, graph, start, codebook, _measures(inputs, graph, codebook, kept))


def _measures(
    inputs: NDArray[np.float64], graph: Lattice, codebook: NDArray[np.float64], kept: NDArray[np.bool_]
) -> dict[str, Any]:
    winners, squared = match(np.ascontiguousarray(codebook.T), np.ascontiguousarray(inputs.T))
    ends = codebook[graph.edges]
    lengths = np.sqrt(((ends[:, 1] - ends[:, 0]) ** 2).sum(axis=1))
    return {
        "topology": graph.name,
        "neurons": len(graph),
        "inputs": len(inputs),
        "strays": int((~kept).sum()),
        "dead_neurons": int(len(graph) - len(np.unique(winners))),
        "quantization_error": float(np.sqrt(squared).mean()),
        "longest_over_median_edge": float(lengths.max() / max(np.median(lengths), 1e-300)),
    }
