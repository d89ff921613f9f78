"""Which parameters change nothing beside the others that were asked for."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import fields
from typing import TYPE_CHECKING, Any

from .settings import MATTERS, asked_by, option_of
from .ways import choose_way, way_of
from .ways.way import INPUTS, POINTS

if TYPE_CHECKING:
    from collections.abc import Collection
    from dataclasses import Field

    from .settings import Settings

GROUPS = ("network", "cubes", "fit")
"""Groups of parameters that a way must read for them to change anything."""
BESIDE = ("seed",)
"""Parameters of other groups of which the same is true."""
ALWAYS = ("filled", "way", "network", "space", "contours", "slices", "tolerance", "max_steps", "shared_walls")
"""Parameters of those groups that choose the way or matter on each."""
INSTEAD = {"largest": "--keep largest"}
"""Parameter to what does the same on the voxels of a study, whichever way it goes."""


def without_effect(settings: Settings, given: Collection[str], *, input: str) -> list[str]:
    """Say which parameters change nothing, so that nobody waits for what they do not do.

    Parameters
    ----------
    settings : Settings
        All parameters of the run.
    given : collection of str
        The bare names of those that were asked for, with their values where these are known; the others are not
        looked at.
    input : str
        What is read: ``gray`` or ``color`` for a study, ``cloud``, or ``stack`` for a cloud of contours on parallel
        slices.

    Returns
    -------
    list of str
        One sentence each, in the order of the settings.
    """
    way = way_of(choose_way(settings, input))
    values = {name: value for group in settings.to_dict().values() for name, value in group.items()} | {"input": input}
    entries = [(group.name, entry) for group in fields(settings) for entry in fields(getattr(settings, group.name))]
    found = []
    for group, entry in entries:
        name = entry.name
        if name not in given or (isinstance(given, Mapping) and _asks_for_nothing(entry, given[name])):
            continue
        unread = (group in GROUPS or name in BESIDE) and name not in ALWAYS and name not in way.reads
        reason = way.because(settings, input) if unread else _missing(way.reads.get(name, {}), values)
        reason = reason or _missing(MATTERS.get(name, {}), values)
        instead = f": {INSTEAD[name]} has" if name in INSTEAD and input not in POINTS else ""
        found += [f"{asked_by(entry)} has no effect {reason}{instead}"] if reason else []
    return found


def _asks_for_nothing(entry: Field[Any], value: object) -> bool:
    """Tell whether a value leaves to the program what it would choose anyway: a number that is "auto", written out."""
    return bool(entry.metadata["auto"]) and value in (None, "auto")


def _missing(conditions: Mapping[str, tuple[str, ...]], values: Mapping[str, object]) -> str:
    """Name the first value of another parameter that keeps one from changing anything."""
    for key, allowed in conditions.items():
        if values[key] not in allowed:
            return INPUTS[str(values[key])] if key == "input" else f"with {option_of(key)} {values[key]}"
    return ""
