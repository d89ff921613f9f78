"""Networks on the page: one trained while a class looks on, those of all slices, and what is saved of them."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from ...errors import TomomeshError, UsageError
from ...model.contours import Contours
from ...model.networks import Networks
from ...progress import silent
from ...settings import MATTERS
from ..routes import get, levels, post
from ..studies import opened_volume
from .figures import FIGURES
from .selected import selected_of, slices_of
from .trainers import REGIONS, backdrop, head, in_slices, trainer_of

if TYPE_CHECKING:
    from collections.abc import Callable

    from starlette.responses import Response

    from ...progress import Progress
    from ...settings import Settings
    from ..session import Session
    from .course import TrainingCourse

    Told = dict[str, Any]

OPTIONS = (
    "way", "network", "neurons", "signal", "training", "epochs", "iterations", "start", "neighborhood", "radius",
    "radius_fall", "radius_power", "alpha", "alpha_fall", "alpha_power", "least_move", "trim", "even", "bridge",
    "inputs", "seed",
)  # fmt: skip
"""What a training may be asked, in the order of the page."""
OF_SLICES = ("way", "signal", "bridge", "inputs")
"""Those that no test region takes."""
TRAIN, SEGMENT = "train", "segment"
NO_RING = {
    "voxels": "A run with these choices takes the window's own voxels and trains no network: this is what the way "
    "ring trains on the slice.",
    "contours": "A run with these choices trains a ring on each outline (all slices): this is the one that the "
    "way ring trains on the slice.",
    "sphere": "A run with these choices trains one network in space: this is what the way ring trains on the slice.",
}
"""What is said where a slice is trained that a run would not train so."""


def told(session: Session, region: str = "") -> Told:
    """Tell what can be chosen, trained and played; which options matter on a region, or on the study's slices."""
    course = course_of(session)
    return {
        "options": options_of(session.settings, region=bool(region), color=_layers(session) > 1),
        "figures": [one.told for one in FIGURES], "regions": list(REGIONS), "study": _study(session),
        "space": in_space(session.settings), "trained": course is not None,
        "segmented": SEGMENT in session.made,
    }  # fmt: skip


def options_of(settings: Settings, *, region: bool = False, color: bool = False) -> list[str]:
    """Return the options that change anything about a training beside the others."""
    taken = settings if in_space(settings) else in_slices(settings)
    values = {name: value for group in taken.to_dict().values() for name, value in group.items()}
    values |= {"network": taken.network.topology, "contours": "one", "input": "color" if color else "gray"}
    asked = [name for name in OPTIONS if not (region and name in OF_SLICES)]
    return [name for name in asked if all(values[key] in fits for key, fits in MATTERS.get(name, {}).items())]


def in_space(settings: Settings) -> bool:
    """Tell whether a run trains one network in space."""
    return settings.network.in_space or settings.network.way == "sphere"


def train(session: Session, body: Told) -> Told:
    """Begin a training, unless work is underway."""
    return _begin(session, TRAIN, lambda progress: _train(session, body, progress))


def segment(session: Session, body: Told) -> Told:
    """Begin to train all slices, unless work is underway."""
    return _begin(session, SEGMENT, lambda progress: _segment(session, progress))


def _begin(session: Session, name: str, work: Callable[[Progress], Told]) -> Told:
    before = session.jobs.now
    job = session.jobs.start(name, work)
    return {"job": job.told, "started": job is not before}


def _train(session: Session, asked: Told, progress: Progress) -> Told:
    """Train, keeping and telling each epoch; what was seen is kept where it is stopped, too."""
    choices = session.choices.values
    trainer = trainer_of(session, asked, progress)
    course = trainer.course
    course.require_watchable()
    course.note = _noted(session, asked, progress)
    session.keep(TRAIN, course, choices)
    session.events.tell({"event": "training", **course.told()})
    try:
        course.end(*trainer.train(course.look(session.events.tell, progress)), session.events.tell)
    finally:
        course.state = "stopped" if course.state == "running" else course.state
    return {"count": len(course.frames)}


def _noted(session: Session, asked: Told, progress: Progress) -> str:
    """Say where a run would not train the slice so."""
    if "slice" not in asked:
        return ""
    from ...ways.choice import take_way

    taken = take_way(selected_of(session, progress), session.settings)
    return NO_RING.get(taken.value.network.way, "")


def _segment(session: Session, progress: Progress) -> Told:
    """Train all slices: the very call of ``tomomesh segment``."""
    from ...pipeline import segment as run

    choices, labels = session.choices.values, session.opened.chosen_labels(session.settings)
    found = run(opened_volume(session), session.settings, labels=labels, progress=progress, **choices)
    session.keep(SEGMENT, found, choices)
    return {"slices": _slices_with(found.source)}


def course_of(session: Session) -> TrainingCourse | None:
    """Return the last training."""
    made = session.made.get(TRAIN)
    return None if made is None else made.value


def _course(session: Session) -> TrainingCourse:
    course = course_of(session)
    if course is None:
        raise UsageError("nothing has been trained yet", expected="Train first")
    return course


def training(session: Session, first: str = "0") -> Told:
    """Tell of the last training, with its frames from one on; null where there was none."""
    course = course_of(session)
    return {"training": None if course is None else course.told(int(first))}


def inputs(session: Session) -> Response:
    """Hand out what the network is shown, (n, 2 or 3), where it is drawn."""
    return levels(_course(session).places.astype(np.float32))


def picture(session: Session, k: str = "", of: str = "study") -> Response:
    """Hand out a slice, (2, J, I): from black to white, and what is kept.

    `of` is study, head for the built-in one, or training for that of the last.
    """
    if of == "study":
        kept = selected_of(session, silent)
        back = backdrop(kept, range(kept.study.shape[0])[int(k)])
    else:
        found = head().backdrop if of == "head" else _course(session).backdrop
        if found is None:
            raise LookupError
        back = found
    spacing = ",".join(map(str, back.plane.spacing_mm))
    return levels(np.stack([back.gray, back.kept]), spacing=spacing, upward=int(back.plane.upward))


def networks_on(session: Session, k: int | str) -> Told:
    """Tell of the networks that all slices' training has on one: their neurons in pixels, and their links."""
    made = session.made.get(SEGMENT)
    if made is None:
        raise UsageError("the slices have not been trained yet", expected="All slices")
    source, number = made.value.source, int(k)
    fresh = made.choices == session.choices.values
    return {"slice": number, "fresh": fresh, "slices": _slices_with(source), "networks": _on_slice(source, number)}


def _slices_with(source: Any) -> list[int]:
    """Return the slices that have networks."""
    return [int(k) for k in source.slices] if isinstance(source, Networks | Contours) else []


def _on_slice(source: Any, k: int) -> list[Told]:
    if isinstance(source, Networks) and k in source.slices:
        n, graph = int(np.searchsorted(source.slices, k)), source.lattice
        return [_network(source.codebooks[n], graph.edges, source.bridged[n])]
    each = source.by_slice.get(k, []) if isinstance(source, Contours) else []
    return [_network(one.codebook, _around(len(one)), one.bridged) for one in each]


def _around(count: int) -> Any:
    return np.stack([np.arange(count), (np.arange(count) + 1) % count], axis=1)


def _network(codebook: Any, edges: Any, bridged: Any) -> Told:
    return {
        "codebook": codebook.ravel().tolist(), "edges": edges.ravel().tolist(),
        "bridged": np.flatnonzero(bridged).tolist(),
    }  # fmt: skip


def _layers(session: Session) -> int:
    volume = session.opened.volume
    return 1 if volume is None else volume.layers


def _study(session: Session) -> Told | None:
    """Tell of the slices that are looked at; the line of the fault where the choices leave none."""
    if session.opened.volume is None:
        return None
    try:
        laid = slices_of(session)
    except TomomeshError as fault:
        return {"slices": 0, "fault": str(fault)}
    return {"slices": laid.volume.shape[0], "plane": laid.plane}


ROUTES = [
    get("/api/networks", told),
    get("/api/networks/{k:int}", networks_on),
    post("/api/train", train),
    post("/api/segment", segment),
    get("/api/training", training),
    get("/training/inputs", inputs),
    get("/training/picture", picture),
]
