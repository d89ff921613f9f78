"""What the page can train: the network of a slice as the run trains it, one in space, one on a test region."""

from __future__ import annotations

from dataclasses import replace
from functools import lru_cache
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from ...errors import UsageError
from ...model.lattice import lattice
from ...segmentation.networks.one import OneSlice
from ...segmentation.signal import pixels_of
from ...segmentation.space import pieces_of, shown_of, train_space
from ...settings import IN_SLICE, SURFACES
from ...show.plane import Plane, contrast, gray
from ...som.fit import fit
from ...som.region import train_region
from ...som.shapes import SHAPES, shape
from ...ways.rings import slices_of
from ...ways.space import shown_in_space
from .course import Backdrop, TrainingCourse
from .selected import selected_of

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

    from ...model.volume import Volume
    from ...progress import Progress
    from ...segmentation.study import Selected
    from ...settings import Settings
    from ...som.passes import Look
    from ..session import Session

    Floats = NDArray[np.float64]
    Trained = tuple[Floats, NDArray[np.bool_] | None]

SINGLE = "input"
REGIONS = (*SHAPES, "head", SINGLE)
"""Test regions: the paper's, a slice of the built-in head, and a single input, which is presented again and again."""
HEAD, PIXEL_MM = (9, 160, 160), (1.5, 1.5, 17.0)
HEAD_SLICE = 1
"""The slice of the built-in head at the height of the nose, whose skull is open there as the paper's is."""
SIGNAL = 8
"""The neuron of ten that is next to the single input, as in Fig. 1: the last but one."""


class Trainer(NamedTuple):
    """A training that can be begun.

    Attributes
    ----------
    course : TrainingCourse
        What is kept of it.
    train : callable
        Trains for who looks on; returns the neurons as the run hands them on, where they are drawn, and which edges
        bridge gaps, where that is known.
    """

    course: TrainingCourse
    train: Callable[[Look], Trained]


def trainer_of(session: Session, asked: dict[str, Any], progress: Progress) -> Trainer:
    """Return what trains a slice ({"slice": k}), a region ({"region": name}), or the window in space ({"space": true}).

    Raises
    ------
    UsageError
        For anything else.
    """
    settings = session.settings
    if isinstance(asked.get("region"), str):
        return on_region(asked["region"], settings)
    if session.opened.volume is None:
        raise UsageError("no study is open, or it is still being read", expected=f"a region: {' | '.join(REGIONS)}")
    if asked.get("space") is True:
        return in_space(selected_of(session, progress), settings)
    if isinstance(asked.get("slice"), int):
        return on_slice(selected_of(session, progress), asked["slice"], settings, progress)
    raise UsageError("there is no such thing to train", found=", ".join(asked), expected="slice | region | space")


def in_slices(settings: Settings) -> Settings:
    """Return the settings with which one network is trained on each slice: as asked for, or as ``--way ring``."""
    asked = settings.network
    network = "ring" if asked.network in ("auto", "none", *SURFACES) else asked.network
    return replace(settings, network=replace(asked, way="ring", network=network, space="slice", contours="one"))


def on_slice(kept: Selected, k: int, settings: Settings, progress: Progress) -> Trainer:
    """Train the network that the run has on a slice: the same inputs, start and seed."""
    count = kept.study.shape[0]
    if not 0 <= k < count:
        raise UsageError("there is no such slice", found=str(k), expected=f"0 to {count - 1}")
    taken, run = in_slices(settings), settings.run
    one = OneSlice.of(slices_of(kept, taken), k, threads=run.threads, progress=progress)
    pixel = one.slices.pixel_mm
    course = TrainingCourse(
        f"Slice {k}", {"slice": k}, taken, one.lattice, one.shown, pixel, "mm", backdrop=backdrop(kept, k)
    )
    return Trainer(course, one.train)


def in_space(kept: Selected, settings: Settings) -> Trainer:
    """Train the network that the run has in space."""
    taken = replace(settings, network=settings.network.taking("sphere"))
    asked, run = taken.network, settings.run
    shown = shown_in_space(kept, pieces_of(kept.mask)[0], taken)
    graph = lattice(asked.topology, asked.neuron_count)
    places = shown_of(shown.places, len(graph))

    def train(look: Look) -> Trained:
        found = train_space(shown.places, asked, outlined=shown.outlined, seed=run.seed, look=look)
        return found.codebook, None

    course = TrainingCourse("The window in space", {"space": True}, taken, graph, places, (1.0, 1.0, 1.0), "mm")
    return Trainer(course, train)


def on_region(name: str, settings: Settings) -> Trainer:
    """Train a network on a test region, as ``tomomesh network`` does.

    Raises
    ------
    UsageError
        For a region that there is not.
    """
    if name not in REGIONS:
        raise UsageError("there is no such region", found=name, expected=" | ".join(REGIONS))
    if settings.network.network == "none":
        settings = replace(settings, network=replace(settings.network, network="auto"))
    if name == SINGLE:
        return _on_one_input(settings)
    asked = settings.network
    graph = lattice(asked.topology, asked.neurons or IN_SLICE)
    inputs, area, back = head() if name == "head" else (*shape(name), None)
    scale = (1.0,) * inputs.shape[1] if back is None else back.plane.spacing_mm
    unit = "sides" if back is None else "mm"
    course = TrainingCourse(_titled(name), {"region": name}, settings, graph, inputs, scale, unit, backdrop=back)

    def train(look: Look) -> Trained:
        found = train_region(inputs, asked, seed=settings.run.seed, pixel_area=area, look=look)
        return found.codebook / scale, None

    return Trainer(course, train)


def _titled(name: str) -> str:
    return "The built-in head" if name == "head" else f"A {name}"


def _on_one_input(settings: Settings) -> Trainer:
    """Present one input again and again to neurons on a circle: who wins, and who follows (Fig. 1)."""
    asked = settings.network
    graph = lattice(asked.topology, asked.neurons or 10)
    turn = np.pi * (0.5 - 2 * (np.arange(len(graph)) + 0.5) / len(graph))
    start = np.stack([np.cos(turn), np.sin(turn)], axis=1)
    inputs = 0.15 * start[[min(SIGNAL, len(graph) - 1)]]
    once = replace(asked, training="online", trim=0.0, least_move=0.0)
    course = TrainingCourse(
        "A single input", {"region": SINGLE}, replace(settings, network=once), graph, inputs, (1.0, 1.0)
    )

    def train(look: Look) -> Trained:
        rng = np.random.default_rng(settings.run.seed)
        return fit(inputs, graph, once, rng, pixel_area=0.0, start=start, look=look).codebook, None

    return Trainer(course, train)


class Pictured(NamedTuple):
    """A slice as a region: inputs (n, 2) in mm, the area of a pixel, and the slice itself."""

    inputs: Floats
    area: float
    backdrop: Backdrop


@lru_cache(maxsize=1)
def head() -> Pictured:
    """Return the skull on a slice of the built-in head."""
    from ...head_phantom import phantom

    made = phantom(HEAD, PIXEL_MM)
    plane = made.volume.voxels[HEAD_SLICE]
    kept = (plane > made.lower) & (plane <= made.upper)
    spacing = PIXEL_MM[:2]
    back = Backdrop(_grays(plane), kept.astype(np.uint8), Plane(spacing))
    return Pictured(pixels_of(kept) * spacing, spacing[0] * spacing[1], back)


def backdrop(kept: Selected, k: int) -> Backdrop:
    """Return a slice and what is kept of it."""
    mask = np.asarray(kept.chosen.runs[k]).astype(np.uint8)
    return Backdrop(_grays(slice_of(kept.study, k)), mask, plane_of(kept.study, kept.plane))


def slice_of(study: Volume, k: int) -> NDArray[Any]:
    """Return the levels of a slice (J, I) or (J, I, L)."""
    from ...model.sliced import some_of

    return np.asarray(some_of(study.voxels, k, k + 1)[0])


def plane_of(study: Volume, plane: str) -> Plane:
    """Return how the slices of a study lie in a picture."""
    columns, rows, _ = study.spacing_mm
    return Plane((columns, rows), upward=plane != "axial")


def _grays(levels: NDArray[Any]) -> NDArray[np.uint8]:
    """Return levels from black to white."""
    found = gray(levels)
    low, high = contrast(found[np.isfinite(found)]) if np.isfinite(found).any() else (0.0, 1.0)
    shown = np.nan_to_num((found - low) / ((high - low) or 1.0), nan=0.0, posinf=1.0, neginf=0.0)
    return np.asarray(np.round(255 * np.clip(shown, 0, 1)), np.uint8)
