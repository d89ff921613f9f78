"""Which way a study goes: as it was asked for, or as its window needs it.

A ring on every slice follows one closed line. Where the window is more than that, its own voxels are the surface:
measured on the studies that docs/ways.md lists, no network comes as near.
"""

from __future__ import annotations

from dataclasses import dataclass, fields, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from ..segmentation.outlines import outlines_of
from ..segmentation.study import chosen_by
from ..settings import asked_by
from ..stage import Stage, measured

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from ..segmentation.outlines import Outlines
    from ..segmentation.study import Selected
    from ..settings import NetworkSettings, Settings

NEARLY = 0.95
"""Share of the slices that must be one outline for one ring a slice. Measured: 1.00 on the built-in head's skull and on
plain solids, at most .83 on skins and skulls of studies; half and twice as many others change none of 42 windows."""
JUMP = 0.02
"""Share of a solid's pixels by which two neighboring slices may differ, or that its first or last slice may have. Rings
end half a slice inside. Chosen: a ball of 32 slices has .006 and its mesh 98.5 % of the volume, a cylinder .031 and
96 %. Half changes none of 42 windows, twice lets cylinders pass, whose ring is .5 mm off where a ball's is .23."""
ONE = "one outline a slice"
LABELS = "labels are drawn to the voxel"
OPEN = ("slices", "way", "network", "space", "contours")
"""Parameters of networks that ask for none."""


@dataclass(frozen=True)
class Taken:
    """A way, and why.

    Attributes
    ----------
    way : str
        One of `tomomesh.settings.OF_STUDIES`.
    because : str
    chosen : bool
        Whether the window chose it, and not the settings.
    """

    way: str
    because: str
    chosen: bool


def take_way(kept: Selected, settings: Settings) -> Stage[Settings]:
    """Return the settings with nothing about the way left open, and tell why and what the other ways would be.

    Parameters
    ----------
    kept : Selected
        What is looked at of the study.
    settings : Settings
    """
    seen = measured("way", outlines_of, kept.chosen.runs.cropped(kept.chosen.box), kept.study.spacing_mm[:2])
    found, asked = seen.value, settings.network
    against = against_one_ring(found, chosen_by(settings))
    taken = asked_way(asked) or chosen_way(asked, against)
    told = {"chosen": taken.chosen, "because": taken.because, "option": f"--way {taken.way}"}
    told |= figures(found) | {"others": others(found, against, taken.way)}
    return Stage(replace(settings, network=asked.taking(taken.way)), {"way": told}, seconds=seen.seconds)


def asked_way(asked: NetworkSettings) -> Taken | None:
    """Return the way that the settings name, or that their details take; None where the window is to choose."""
    if asked.detailed:
        return Taken(asked.detailed, f"asked for by {asked.details}", chosen=False)
    if asked.way == "auto":
        return None
    return Taken("ring" if asked.way == "paper" else asked.way, f"asked for by --way {asked.way}", chosen=False)


def known_way(settings: Settings) -> Taken | None:
    """Return the way that the settings alone tell, whatever the window is; None where it is to choose."""
    labelled = chosen_by(settings) == "labels"
    return asked_way(settings.network) or (chosen_way(settings.network, LABELS) if labelled else None)


def chosen_way(asked: NetworkSettings, against: str) -> Taken:
    """Choose one ring a slice where nothing speaks against it; else voxels, or several rings to who asks for networks.

    Parameters
    ----------
    asked : NetworkSettings
    against : str
        As `against_one_ring` returns it.
    """
    if not against:
        return Taken("ring", ONE, chosen=True)
    named = [entry for entry in fields(asked) if entry.name not in OPEN]
    options = ", ".join(asked_by(entry) for entry in named if getattr(asked, entry.name) != entry.default)
    if options:
        return Taken("contours", f"{against}; {options} asks for networks", chosen=True)
    return Taken("voxels", against, chosen=True)


def against_one_ring(found: Outlines, source: str) -> str:
    """Say what keeps one ring a slice from being the surface of a window; "" where nothing does.

    Parameters
    ----------
    found : Outlines
    source : {"given", "otsu", "preset", "labels"}
        What chose the window.
    """
    if source == "labels":
        return LABELS
    if found.share(found.single) < NEARLY:
        return f"{_counted(found.pieces, found)} and {_counted(found.holes, found)} a slice"
    return _against_wall(found, source) if found.wall else _against_solid(found)


def _against_wall(found: Outlines, source: str) -> str:
    if source == "preset":
        return "a wall, and a preset means both its sides"
    return "" if found.ringed else "thin or bent, and around nothing on most slices"


def _against_solid(found: Outlines) -> str:
    if found.share(found.round) < NEARLY:
        return f"a solid whose outline winds on {1 - found.share(found.round):.0%} of the slices"
    return f"a solid with a step of {found.jump:.1%} of it from one slice to the next" if found.jump > JUMP else ""


def _counted(each: NDArray[np.int64], found: Outlines) -> str:
    """Name the mean number of pieces or holes on the slices that hold something."""
    number, word = f"{each[found.filled].mean():.3g}", "piece" if each is found.pieces else "hole"
    return f"{number} {word}" if number == "1" else f"{number} {word}s"


def figures(found: Outlines) -> dict[str, Any]:
    """Return what a way is chosen by, as the report tells it."""
    pixels = found.area.sum()
    return {
        "slices": int(np.count_nonzero(found.filled)),
        "pieces": int(found.pieces.sum()),
        "holes": int(found.holes.sum()),
        "single_share": found.share(found.single),
        "round_share": found.share(found.round),
        "wall": found.wall,
        "ringed": found.ringed,
        "largest_piece_share": float(found.largest.sum() / pixels),
        "holes_share": float(found.hollow.sum() / (pixels + found.hollow.sum())),
        "thickness_mm": found.thickness_mm,
        "thickness_pixels": found.thickness_mm / found.pixel_mm2**0.5,
        "bodies": found.bodies,
        "largest_body_share": found.largest_body,
        "forks": found.forks,
        "jump_share": found.jump,
    }


def others(found: Outlines, against: str, taken: str) -> dict[str, dict[str, Any]]:
    """Say of every other way whether it applies, what it would give or why it does not, and which option takes it."""
    outlines, part = int(found.pieces.sum() + found.holes.sum()), f"{found.largest_body:.0%} of the voxels"
    told = {
        "ring": (not against, against or ONE),
        "contours": (True, f"a ring on each of the {outlines} outlines that is long enough for one"),
        "voxels": (True, f"the boundary of all voxels, in {found.bodies} piece(s)"),
        "sphere": (found.largest_body >= NEARLY, f"one surface of genus 0 around {part}"),
        "paper": (not against, against or "one ring a slice, by the paper's own choices"),
    }
    return {
        name: {"applies": applies, "reason": reason, "option": f"--way {name}"}
        for name, (applies, reason) in told.items()
        if name != taken
    }
