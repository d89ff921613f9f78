"""Which parameters change nothing beside the others that were asked for."""

from __future__ import annotations

from dataclasses import fields
from typing import TYPE_CHECKING

from .parameter import asked_by, option_of

if TYPE_CHECKING:
    from collections.abc import Collection, Mapping

    from . import Settings

CUBES = ("networks", "nearest", "cloud")
"""Ways to a mesh that go by cubes: rings of slices, clouds under ``--attraction nearest``, and other clouds."""
SPRINGS = ("networks", "nearest", "space nearest")
"""Ways whose mesh hangs on springs between masses."""
TRAINED = ("networks", "contours", "space", "space nearest")
"""Ways that train networks; ``voxels`` has none."""
CLOUDS = ("cloud", "stack")
"""Kinds of points; a stack is a cloud of contours on parallel slices."""
ONLINE, BATCH = {"training": ("online",)}, {"training": ("batch",)}

MATTERS: Mapping[str, Mapping[str, tuple[str, ...]]] = {
    "layers": {"input": ("color",)},
    "inputs": {"way": TRAINED, "input": ("color",)},
    "signal": {"way": TRAINED, "contours": ("one", "components")},
    "neurons": {"way": TRAINED},
    "training": {"way": TRAINED},
    "iterations": {"way": TRAINED, **ONLINE},
    "epochs": {"way": TRAINED, **BATCH},
    "start": {"way": TRAINED, "contours": ("one", "components")},
    "neighborhood": {"way": TRAINED},
    "alpha": {"way": TRAINED, **ONLINE},
    "alpha_fall": {"way": TRAINED, **ONLINE},
    "alpha_power": {"way": TRAINED, **ONLINE, "alpha_fall": ("power",)},
    "radius": {"way": TRAINED},
    "radius_fall": {"way": TRAINED},
    "radius_power": {"way": TRAINED, "radius_fall": ("power",)},
    "least_move": {"way": TRAINED},
    "bridge": {"way": ("networks", "contours")},
    "even": {"way": ("networks", "contours"), "network": ("chain", "ring")},
    "trim": {"way": TRAINED},
    "cell_mm": {"way": (*CUBES, "contours", "stack")},
    "cell_factor": {"way": (*CUBES, "contours", "stack")},
    "caps": {"way": ("networks",)},
    "closing": {"way": CUBES},
    "stacks": {"way": CLOUDS},
    "largest": {"way": CUBES},
    "allow_leaks": {"way": (*CUBES, "stack")},
    "open": {"way": ("cloud",)},
    "surface": {"way": (*CUBES, "voxels")},
    "smoothing": {"way": CUBES},
    "attraction": {"way": ("nearest", *CLOUDS, "space", "space nearest")},
    "stiffness": {"way": (*SPRINGS, "voxels", "contours", "stack")},
    "damping": {"way": (*SPRINGS, "cloud", "space")},
    "step": {"way": (*SPRINGS, "cloud", "space")},
    "springs": {"way": SPRINGS},
    "limit": {"way": SPRINGS},
    "allow_returns": {"way": SPRINGS},
    "units": {"input": CLOUDS},
    "local_origin": {"input": CLOUDS},
    "seed": {"way": TRAINED},
}
"""Parameter to what must hold so that it changes anything: another parameter's values, what is read (gray or color
study, cloud or stack), or the way to the mesh. Those that always matter are not named."""

INPUTS = {
    "gray": "on a gray study", "color": "on a color study", "cloud": "on a cloud", "stack": "on a stack of contours",
}  # fmt: skip
INSTEAD = {"largest": "--keep largest"}
"""Parameter to what does the same on the voxels of a study, whichever way it goes."""


def without_effect(settings: Settings, given: Collection[str], *, input: str) -> list[str]:
    """Say which parameters change nothing, so that nobody waits for what they do not do.

    Parameters
    ----------
    settings : Settings
        All parameters of the run.
    given : collection of str
        The bare names of those that were asked for; the others are not looked at.
    input : str
        What is read: ``gray`` or ``color`` for a study, ``cloud``, or ``stack`` for a cloud of contours on parallel
        slices.

    Returns
    -------
    list of str
        One sentence each, in the order of the settings.
    """
    way, because = _way(settings, input)
    entries = [entry for group in fields(settings) for entry in fields(getattr(settings, group.name))]
    values = {name: value for group in settings.to_dict().values() for name, value in group.items()}
    values |= {"way": way, "input": input}
    reasons = {"way": because, "input": INPUTS[input]}
    found = []
    for entry in (entry for entry in entries if entry.name in given):
        failed = [key for key, allowed in MATTERS.get(entry.name, {}).items() if values[key] not in allowed]
        instead = f": {INSTEAD[entry.name]} has" if entry.name in INSTEAD and input not in CLOUDS else ""
        found += [f"{asked_by(entry)} has no effect {_reason(key, values, reasons)}{instead}" for key in failed[:1]]
    return found


def _reason(key: str, values: Mapping[str, object], reasons: Mapping[str, str]) -> str:
    return reasons.get(key) or f"with {option_of(key)} {values[key]}"


def _way(settings: Settings, input: str) -> tuple[str, str]:
    """Return which way leads to the mesh, and what took it there, in words."""
    network, nearest = settings.network, settings.fit.attraction == "nearest"
    if input in CLOUDS:
        return ("nearest", "on a cloud with --attraction nearest") if nearest else (input, INPUTS[input])
    if network.network == "none":
        return "voxels", "with --network none"
    if network.in_space:
        asked = "--space volume" if network.space == "volume" else f"--network {network.network}"
        return ("space nearest" if nearest else "space"), f"with {asked}"
    if network.contours != "one":
        return "contours", f"with --contours {network.contours}"
    return "networks", "on networks of slices"
