"""Train one network on a test region or on one picture (the paper's Fig. 2)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from ..errors import EmptyError, UsageError
from ..model.lattice import lattice, other_number
from ..settings import IN_SLICE
from .even_spacing import bridged_edges, even_spacing
from .fit import fit, start_positions
from .measures import network_measures
from .schedules import schedule_warnings

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from ..model.lattice import Lattice
    from ..settings import NetworkSettings
    from .history import History
    from .passes import Look


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
        How well the network lies, lengths in the unit of the inputs; what to be warned of under ``"warnings"``.
    history : History
        What happened in each epoch.
    """

    inputs: NDArray[np.float64]
    lattice: Lattice
    start: NDArray[np.float64]
    codebook: NDArray[np.float64]
    measures: dict[str, Any]
    history: History


def train_region(
    inputs: NDArray[np.float64], settings: NetworkSettings, *, seed: int = 0, pixel_area: float = 1.0,
    look: Look | None = None,
) -> TrainedNetwork:  # fmt: skip
    """Train a network on inputs of any dimension.

    Parameters
    ----------
    inputs : (n, d) float array
    settings : NetworkSettings
    seed : int
    pixel_area : float
        Area that one input stands for.
    look : Look, optional
        Who is told of the start and of each epoch.

    Returns
    -------
    TrainedNetwork

    Raises
    ------
    UsageError
        For inputs that are no rows of numbers.
    EmptyError
        With fewer inputs than neurons.
    """
    if inputs.ndim != 2 or inputs.shape[1] < 1:
        raise UsageError("inputs are rows of numbers", found=f"shape = {inputs.shape}", expected="(n, d)")
    graph = lattice(settings.topology, settings.neurons or IN_SLICE)
    if len(inputs) < len(graph):
        raise EmptyError(
            "the region has fewer inputs than the network has neurons",
            found=f"{len(inputs)} inputs",
            expected=f"at least {len(graph)}",
            hint="a wider window, or fewer --neurons",
        )
    start = start_positions(inputs, graph, settings.start, np.random.default_rng(seed))
    rng = np.random.default_rng(seed)
    fitted = fit(inputs, graph, settings, rng, pixel_area=pixel_area, record=True, look=look)
    codebook = fitted.codebook
    if settings.even:
        codebook, _ = even_spacing(codebook, graph, bridged_edges(codebook, graph, settings.bridge))
    measures = _measures(inputs, graph, codebook, fitted.kept)
    measures |= {"epochs": len(fitted.history), "seed": seed, "warnings": _warnings(graph, settings)}
    return TrainedNetwork(inputs, graph, start, codebook, measures, fitted.history)


def _warnings(graph: Lattice, settings: NetworkSettings) -> list[str]:
    other = other_number(graph, settings.neurons)
    return [*schedule_warnings(settings), *([other] if other else [])]


def _measures(
    inputs: NDArray[np.float64], graph: Lattice, codebook: NDArray[np.float64], kept: NDArray[np.bool_]
) -> dict[str, Any]:
    ends = codebook[graph.edges]
    lengths = np.sqrt(((ends[:, 1] - ends[:, 0]) ** 2).sum(axis=1))
    return {
        "topology": graph.name,
        "neurons": len(graph),
        "inputs": len(inputs),
        "strays": int((~kept).sum()),
        **network_measures(codebook, graph, inputs),
        "longest_over_median_edge": float(lengths.max() / max(np.median(lengths), 1e-300)),
    }
