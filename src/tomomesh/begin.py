"""How a run begins: its settings, what is looked at of a study and kept of it, and which way that goes."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from .effect import without_effect
from .errors import UsageError
from .segmentation.selection import STEPS
from .segmentation.study import lay_out, select_in
from .settings import Settings
from .stage import Stage, folded
from .ways import choose_way, way_of
from .ways.choice import take_way

if TYPE_CHECKING:
    from collections.abc import Collection

    from .model.volume import Volume
    from .progress import Progress
    from .segmentation.study import LaidOut, Selected
    from .ways.way import Way


def settled(settings: Settings | None, changes: dict[str, Any], *, every: bool = False) -> Settings:
    """Return the settings of a run; refuse those whose packages are not installed, or that are for every label."""
    settings = (settings or Settings()).replace(**changes)
    if settings.cubes.shared_walls and not every:
        raise UsageError(
            "walls are shared among all labels of a map", found="--shared-walls for one mesh", hint="--each-label"
        )
    if settings.printing.asked:
        from .printing.part import require_printing

        require_printing(settings)
    return settings


def _input_of(volume: Volume) -> str:
    return "color" if getattr(volume, "layers", 1) > 1 else "gray"


def begin(settings: Settings, given: Collection[str], *, input: str) -> Stage[Way]:
    """Choose the way, and warn of what was asked for and changes nothing on it."""
    way = way_of(choose_way(settings, input))
    section = {"name": way.name, "because": way.because(settings, input)}
    return Stage(way, {"way": section}, tuple(without_effect(settings, given, input=input)))


def require_way(settings: Settings, input: str = "gray") -> None:
    """Refuse settings that their way to a surface cannot do, before any work."""
    way_of(choose_way(settings, input)).require(settings)


def laid_out(
    volume: Volume, labels: Volume | None, settings: Settings, progress: Progress, *, labelled: bool
) -> LaidOut:
    """Lay out a study (`lay_out`), once its way to a surface does not refuse the settings."""
    require_way(settings, _input_of(volume))
    progress("window", 0, STEPS)
    return lay_out(volume, labels, settings, labelled=labelled)


@dataclass(frozen=True)
class Begun:
    """A study of which it is known what is kept and which way it goes.

    Attributes
    ----------
    kept : Selected
    way : Way
    settings, taken : Settings
        As they were asked for, and with nothing about the way left open.
    told : Stage
        What there is to be told so far.
    """

    kept: Selected
    way: Way
    settings: Settings
    taken: Settings
    told: Stage[None]


def begun_on(study: LaidOut, settings: Settings, given: Collection[str], progress: Progress) -> Begun:
    """Choose the voxels of a study that was laid out, and the way to their surface; parameters as `reconstructed`."""
    kept = select_in(study, settings, progress)
    taken = take_way(kept.value, settings)
    progress("window", STEPS, STEPS)
    begun = begin(taken.value, given, input=_input_of(study.volume))
    return Begun(kept.value, begun.value, settings, taken.value, folded(None, begun, taken, kept))
