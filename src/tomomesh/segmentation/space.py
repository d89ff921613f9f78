"""Train one network in space, on the voxels of a whole window."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
import scipy

from ..dynamics.low_pass import OneRing
from ..dynamics.untangle import untangle
from ..errors import EmptyError
from ..measure.intersections import CrossingFaces
from ..model.lattice import lattice
from ..model.mesh import TriMesh
from ..model.networks import SpaceNetwork
from ..settings import SURFACES
from ..som.fit import fit
from ..som.starts import start_positions
from .signal import closed

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from ..settings import NetworkSettings
    from ..som.passes import Look

MOST = 40_000
"""Inputs a network in space is shown at most: every n-th, in the order of slices, rows and columns, beyond. Measured on
two heads: half and twice of it change the volume by at most 0.2 %."""
HOLLOW = 2.0
"""Times its own pixels that a window must enclose, slice by slice, to count as a wall.

Measured: skulls 2.4 and 4.3; heads, white matter, ventricles and a torus of tube over ring 0.4 1.0 to 1.4.
"""
PIECE = 0.05
"""Voxels of a piece of the window over those of the largest, under which it is left out. Chosen: half and twice of it
change no case of benchmarks/constants.py."""


def is_wall(mask: NDArray[np.bool_]) -> bool:
    """Tell whether a window (K, J, I) is a wall around something, like a skull, whose middle the network shall take."""
    enclosed = sum(int(np.count_nonzero(closed(plane)[0])) for plane in mask if plane.any())
    return enclosed > HOLLOW * int(np.count_nonzero(mask))


def sees_boundary(mask: NDArray[np.bool_], asked: NetworkSettings) -> bool:
    """Tell whether a network sees a window's boundary; a torus, which has a hole of its own, is no wall."""
    if asked.signal != "auto" or asked.network not in SURFACES:
        return asked.signal == "boundary"
    return asked.network == "torus" or not is_wall(mask)


def pieces_of(mask: NDArray[np.bool_]) -> tuple[NDArray[np.bool_], int]:
    """Leave out the small pieces of a window (K, J, I); return also how many pieces it then has."""
    labels, _ = scipy.ndimage.label(mask, np.ones((3, 3, 3), bool))
    sizes = np.bincount(labels.ravel())
    sizes[0] = 0
    kept = sizes >= PIECE * sizes.max()
    kept[0] = False
    return kept[labels], int(kept.sum())


def shown_of(inputs: NDArray[np.float64], neurons: int) -> NDArray[np.float64]:
    """Return the inputs that so many neurons are shown: at most `MOST`, evenly taken, and as many as there are neurons.

    Raises
    ------
    EmptyError
        With fewer inputs than neurons.
    """
    if len(inputs) < neurons:
        raise EmptyError(
            "the window has fewer places than the network has neurons", found=f"{len(inputs)} places",
            expected=f"at least {neurons}", hint="a wider window, or fewer --neurons",
        )  # fmt: skip
    shown = inputs[:: -(-len(inputs) // MOST)]
    return shown if len(shown) >= neurons else inputs


def train_space(
    inputs: NDArray[np.float64], settings: NetworkSettings, *, outlined: bool, seed: int = 0, look: Look | None = None
) -> SpaceNetwork:
    """Train one network on places in patient millimeters.

    Parameters
    ----------
    inputs : (n, 3) float array
        Voxels of a window, or its boundary; at most `MOST` are shown, evenly taken.
    settings : NetworkSettings
        A torus starts along the principal axes, since the hole has to be where the object's is.
    outlined : bool
        Whether they are a boundary. Then none counts as stray: what lies far off is in a bay.
    seed : int
    look : Look, optional
        Who is told of the start and of each epoch.

    Returns
    -------
    SpaceNetwork

    Raises
    ------
    EmptyError
        With fewer inputs than neurons.
    """
    graph = lattice(settings.topology, settings.neuron_count)
    shown = shown_of(inputs, len(graph))
    start = "axes" if (settings.topology, settings.start) == ("torus", "ellipse") else settings.start
    asked = replace(settings, start=start, trim=0.0 if outlined else settings.trim)
    origin = shown.mean(axis=0)
    if look is not None:
        told = look.told
        look = replace(look, told=lambda codebook, *rest: told(codebook + origin, *rest))
    fitted = fit(shown - origin, graph, asked, np.random.default_rng(seed), look=look)
    return SpaceNetwork(graph, fitted.codebook + origin, outlined, len(shown), int((~fitted.kept).sum()))


def regions_in_space(
    mask: NDArray[np.bool_], places: NDArray[np.float64], network: SpaceNetwork, threads: int = 0
) -> NDArray[np.uint16]:
    """Give every voxel of a window (K, J, I) its winner's number plus 1; `places` (n, 3) are the voxels in mm."""
    labels = np.zeros(mask.shape, np.uint16)
    _, winners = scipy.spatial.cKDTree(network.codebook).query(places, workers=threads or -1)
    labels[mask] = winners + 1
    return labels


def untangled(network: SpaceNetwork, shown: NDArray[np.float64], threads: int = 0) -> tuple[TriMesh, int]:
    """Return a network as a mesh that faces outward and does not pass through itself.

    Where smoothing does not help, it goes back towards its start on the ellipsoid of what it was shown, where it lies
    apart everywhere.

    Parameters
    ----------
    network : SpaceNetwork
        One with faces.
    shown : (n, 3) float array
    threads : int

    Returns
    -------
    mesh : TriMesh
    moved : int
        Neurons that do not lie where the training had them.
    """
    mesh = TriMesh(network.codebook, network.lattice.faces)
    ring = OneRing.of_edges(mesh.edges, len(mesh.vertices), threads)
    start = start_positions(shown, network.lattice, "ellipse", np.random.default_rng(0))
    mesh, moved, _ = untangle(mesh, start, ring, CrossingFaces(threads, single=True), start)
    outward = mesh.face_volumes.sum() > 0
    return mesh if outward else replace(mesh, faces=np.ascontiguousarray(mesh.faces[:, ::-1])), moved
