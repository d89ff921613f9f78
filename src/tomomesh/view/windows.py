"""What the chosen settings keep of a study, as a run would keep it: its components, and those on a slice."""

from __future__ import annotations

import hashlib
import math
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np

from ..errors import TomomeshError, UsageError
from ..isosurface.runs import Runs
from ..model.volume import AXES, order_along
from ..progress import silent
from ..segmentation.picked import component_at
from ..segmentation.study import lay_out, select_in
from .routes import get, levels, post
from .slices import axis_of
from .studies import opened_volume

if TYPE_CHECKING:
    from numpy.typing import NDArray
    from starlette.responses import Response

    from ..model.volume import Volume
    from ..progress import Progress
    from ..segmentation.study import LaidOut, Selected
    from ..settings import Settings
    from ..stage import Stage
    from .session import Session

    Longs = NDArray[np.int64]
    Place = tuple[float, float, float]

LISTED = 24
"""Components that are told one by one. As many as a page has room for."""
OTHERS = 255
"""The number that all components share which have none of their own."""
PICKS = ("keep_at", "drop_at")
"""Parameters that pick components by places in them."""


@dataclass(frozen=True)
class Kept:
    """What some settings keep of a study.

    Attributes
    ----------
    selected : Selected
        The part of the study that was looked at, its slices first, and the voxels that are kept.
    runs : Runs
        These, and their components.
    order : (int, int, int)
        Which of the study's axes (K, J, I) its slices, rows and columns are.
    corner : (3,) int64 array
        The study's voxel (K, J, I) that is the first of the part.
    told : dict
        What the report has of it.
    """

    selected: Selected
    runs: Runs
    order: tuple[int, int, int]
    corner: Longs
    told: dict[str, Any]

    @classmethod
    def of(cls, study: LaidOut, whole: Volume, settings: Settings, progress: Progress = silent) -> Kept:
        """Choose the voxels of a study, a part of a whole one; errors are those of `segmentation.study.select_in`."""
        chosen: Stage[Selected] = select_in(study, settings, progress)
        selected = chosen.value
        order = order_along(AXES.index(selected.plane))
        corner = np.rint(whole.to_indices(selected.study.affine[None, :3, 3])[0, ::-1]).astype(np.int64)
        told = {**chosen.stats, "warnings": list(chosen.warnings)}
        return cls(selected, Runs.of(selected.chosen.runs, corners=True), order, corner, told)

    @cached_property
    def largest(self) -> Longs:
        """The components from the largest on, of equals in their order."""
        return np.argsort(-self.runs.sizes, kind="stable")

    @cached_property
    def numbers(self) -> NDArray[np.int16]:
        """The number of each component, from 1 for the largest on."""
        numbers = np.full(len(self.largest), OTHERS, np.int16)
        numbers[self.largest[: OTHERS - 1]] = np.arange(1, min(len(self.largest), OTHERS - 1) + 1)
        return numbers

    @cached_property
    def _rows(self) -> tuple[Longs, Longs]:
        return np.divmod(self.runs.mask.rows, self.runs.mask.shape[1])

    def plane(self, axis: int, place: int, size: tuple[int, int]) -> NDArray[np.uint8]:
        """Draw the components' numbers on a slice (rows, columns) across one of the study's axes (K, J, I)."""
        drawn = np.zeros(size, np.uint8)
        across, place = self.order.index(axis), place - int(self.corner[axis])
        if 0 <= place < self.runs.mask.shape[across]:
            found = self._drawn(across, place)
            rows, columns = (one for one in range(3) if one != axis)
            turned = self.order.index(rows) > self.order.index(columns)
            found = found.T if turned else found
            first, second = self.corner[rows], self.corner[columns]
            drawn[first : first + found.shape[0], second : second + found.shape[1]] = found
        return drawn

    def _drawn(self, across: int, place: int) -> NDArray[np.uint8]:
        """Draw them across one of the axes of the part."""
        mask, (slices, rows) = self.runs.mask, self._rows
        if across == 2:
            met = np.flatnonzero((mask.starts <= place) & (place < mask.stops))
            drawn = np.zeros(mask.shape[:2], np.uint8)
            drawn[slices[met], rows[met]] = self.numbers[self.runs.parts[met]]
            return drawn
        met, lines = (slices, rows) if across == 0 else (rows, slices)
        held = np.flatnonzero(met == place)
        change = np.zeros((mask.shape[1 - across], mask.shape[2] + 1), np.int16)
        numbers = self.numbers[self.runs.parts[held]]
        change[lines[held], mask.starts[held]] = numbers
        change[lines[held], mask.stops[held]] = -numbers
        return np.cumsum(change, axis=1, dtype=np.int16)[:, :-1].astype(np.uint8)

    def at(self, place: Place) -> int | None:
        """Return the component that holds a place in the patient, mm; None where there is none."""
        return component_at(self.runs, self.selected.study, place)

    def listed(self) -> list[dict[str, Any]]:
        """Tell the largest components: number, voxels, mm3, a voxel inside (K, J, I), and its place in the patient."""
        return [self._listed(n + 1, int(part)) for n, part in enumerate(self.largest[:LISTED])]

    def _listed(self, number: int, part: int) -> dict[str, Any]:
        held = np.flatnonzero(self.runs.parts == part)
        (slices, rows), mask = self._rows, self.runs.mask
        middle = held[len(held) // 2]
        inside = np.array([slices[middle], rows[middle], (mask.starts[middle] + mask.stops[middle]) // 2])
        voxels = int(self.runs.sizes[part])
        return {
            "number": number,
            "voxels": voxels,
            "volume_mm3": voxels * self.selected.study.voxel_mm3,
            "place": place_of(self.selected.study, inside),
            "inside": (inside[np.argsort(self.order)] + self.corner).tolist(),
        }


def place_of(volume: Volume, voxel: Longs) -> Place:
    """Return the place in the patient, mm, of a voxel (K, J, I): its middle, to a hundredth of its least side."""
    digits = max(0, math.ceil(2 - math.log10(min(volume.spacing_mm))))
    x, y, z = (round(float(side), digits) for side in volume.to_mm(voxel[None, ::-1].astype(np.float64))[0])
    return x, y, z


def _lies(settings: Settings) -> Any:
    """Return the settings that tell which part of a study is looked at, and whether for labels."""
    window = settings.window
    return settings.read, settings.crop, settings.network.slices, window.select is not None, window.fill_slices


def _key(settings: Settings) -> str:
    """Name the settings that choose voxels."""
    matters = (_lies(settings), settings.window, settings.cubes.shared_walls)
    return hashlib.sha256(repr(matters).encode()).hexdigest()[:16]


def kept(session: Session, picks: bool = True) -> tuple[str, Kept]:
    """Return what the choices of now keep, and the key by which it is known; what is known is not made again.

    Without `picks` it is what would be kept if no component were picked by a place.

    Raises
    ------
    TomomeshError
        As `segmentation.study.select_study`, and where no study is open.
    LookupError
        Where other choices were made, or something else was opened meanwhile, so that nobody waits for this.
    """
    opened_volume(session)
    unpicked = {} if picks else dict.fromkeys(PICKS)
    opened, asked = session.opened, _key(session.settings.replace(**unpicked))

    def still(*_: object) -> None:
        if session.opened is not opened or _key(session.settings.replace(**unpicked)) != asked:
            raise LookupError(asked)

    def choose() -> Kept:
        settings = session.settings.replace(**unpicked)
        still()
        return Kept.of(laid_out(session, settings), opened_volume(session), settings, progress=still)

    return asked, session.selections.of(asked, choose)


def laid_out(session: Session, settings: Settings) -> LaidOut:
    """Lay the study out as settings ask for; what all windows have in common is found once."""

    def lay() -> LaidOut:
        labels, labelled = session.opened.chosen_labels(settings), settings.window.select is not None
        return lay_out(opened_volume(session), labels, settings, labelled=labelled)

    found: LaidOut = session.studies.of(_lies(settings), lay)
    return found


def _kept(session: Session) -> dict[str, Any]:
    """Tell what the choices keep, component by component; or why they keep nothing, which is no fault of the page."""
    opened_volume(session)
    try:
        key, found = kept(session)
    except TomomeshError as fault:
        return {"refused": str(fault), "flags": list(fault.flags)}
    return {"key": key, **found.told, "components": found.listed(), "count": len(found.largest)}


def _pick(session: Session, body: dict[str, Any]) -> dict[str, Any]:
    """Leave out the component at a voxel (K, J, I) of the study, or bring back the one that was left out there."""
    voxel = np.array(body["voxel"], np.int64)
    if session.opened.laid is not None:
        return _pick_label(session, int(session.opened.laid.voxels[tuple(voxel)]))
    place = place_of(opened_volume(session), voxel)
    window, (_, found) = session.settings.window, kept(session)
    keep, drop = list(window.keep_at or ()), list(window.drop_at or ())
    if (part := found.at(place)) is not None:
        if len(found.largest) == 1:
            raise UsageError("there is no other component: nothing would be left", hint="another window")
        others = [one for one in keep if found.at(one) != part]
        keep, drop = (others, drop) if others else (keep, [*drop, place])
    else:
        _, whole = kept(session, picks=False)
        if (part := whole.at(place)) is None:
            raise UsageError("nothing of the window that is kept lies here", hint="--keep all, or another window")
        drop = [one for one in drop if whole.at(one) != part]
        keep = keep if not keep or part in map(whole.at, keep) else [*keep, place]
    return session.choose({"keep_at": keep or None, "drop_at": drop or None})


def _pick_label(session: Session, label: int) -> dict[str, Any]:
    """Choose a label of the map beside the study, or no more."""
    if label == 0:
        raise UsageError("no label lies here", expected="a voxel of one")
    chosen = {*(session.settings.window.select or ())} ^ {label}
    return session.choose({"select": sorted(chosen) or None, **dict.fromkeys(("lower", "upper", "preset"))})


def _plane(session: Session, plane: str, k: str, key: str) -> Response:
    """Return the components' numbers on a slice, of a selection that was told."""
    found: Kept = session.selections.known(key)
    shape, axis = opened_volume(session).shape, axis_of(plane)
    rows, columns = (size for other, size in enumerate(shape) if other != axis)
    return levels(found.plane(axis, int(k), (rows, columns)))


ROUTES = [get("/api/kept", _kept), post("/api/pick", _pick), get("/kept/{plane}/{k}", _plane)]
