"""What is written follows what it was made from: a mesh that is far from it is refused, or told of first of all."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from .errors import GeometryError
from .results import LEAST
from .stage import Stage

if TYPE_CHECKING:
    from collections.abc import Mapping

    from .followed import Apart, Followed
    from .results import Surface
    from .settings import Settings

OTHER_WAY = "--way voxels"
"""The way that holds on every window."""
SURE = ("voxels", "slices")
"""What is followed without a network, where no other way holds better."""
ALLOW = "--allow-far, which writes it all the same"
TWO_WALLS = {
    "rings": f"no --no-caps, a larger --cell-mm or --closing, {OTHER_WAY}, or --allow-leaks",
    "slices": "--allow-leaks, which writes it all the same",
    "samples": "a larger --cell or --closing, or --allow-leaks",
    "window": f"--signal boundary, more --neurons, {OTHER_WAY}, or --allow-leaks",
}
"""What may help, by what a mesh should have enclosed."""
OFF = 0.5
"""Voxels that the whole surface may lie off whatever its volume is: half a voxel is what a window itself is known to,
and takes all of the volume of what is one voxel thick."""
TOLD = 0.5
"""Share of the limits from which on a mesh is told of first. Chosen: half of it tells of every network's, twice of
none that is written."""


@dataclass(frozen=True)
class Limits:
    """How far a mesh may be from what it is to follow.

    Attributes
    ----------
    volume : float
        How often the one volume may hold the other.
    there, back : float
        Distance to the window that 95 % of the surface must keep, and the other way, in units of `Followed`; infinite
        where it is told of, but not refused.
    """

    volume: float
    there: float = np.inf
    back: float = np.inf

    def part(self, share: float) -> Limits:
        """Return the limits of a lower degree; where the surface may lie anywhere, it is held to the window's own."""
        most = share * self.back
        return Limits(1 + share * (self.volume - 1), min(share * self.there, most), most)

    def keys(self, found: Mapping[str, float]) -> dict[str, float | None]:
        """Return them for a report, in voxels; None where nothing is refused."""
        unit = found.get("unit_voxels", 1.0)
        most = {"mesh_to_window": self.there, "window_to_mesh": self.back}
        each = {f"{name}_limit_voxels": value * unit if np.isfinite(value) else None for name, value in most.items()}
        return {"volume_limit": self.volume, **each}

    def in_words(self, found: Mapping[str, float]) -> str:
        """Say them."""
        volume = f"{1 / self.volume:.0%} to {self.volume:.0%} of the volume"
        within = {key: most for key, most in self.keys(found).items() if key.endswith("voxels") and most is not None}
        return f"{volume}, 95 % within {max(within.values()):.3g} voxels" if within else volume


LIMITS = {
    "voxels": Limits(1.25, 2.0, 2.0),
    "contours": Limits(1.25, 5.0, 5.0),
    "outline": Limits(1.25, 4.0, 4.0),
    "wall": Limits(1.6, 2.0, 2.0),
    "space": Limits(1.25, 5.0, 5.0),
    "closed wall": Limits(1.6, np.inf, 5.0),
    "slices": Limits(1.25),
}
"""By what is followed: see docs/report.md for what was measured of sound runs and of wrong ones."""


def require_one_wall(made: Surface, settings: Settings) -> tuple[str, ...]:
    """Refuse a mesh of which both walls rest on the same points, or say so where that was allowed.

    Parameters
    ----------
    made : Surface
        As its way has left it: what is thin loses of its volume where it is smoothed and made even.
    settings : Settings

    Raises
    ------
    GeometryError
    """
    share = 1.0 if made.encloses is None else made.encloses.share(made.mesh)
    if made.encloses is None or share >= LEAST:
        return ()
    found = f"{share:.1%} of the volume of its {made.encloses.what}"
    if settings.cubes.allow_leaks:
        return (f"the mesh encloses {found}: it may have two walls",)
    raise GeometryError(
        "the surface has two walls, or does not follow what it was made from",
        found=found, expected=f"at least {LEAST:.0%}", hint=TWO_WALLS[made.encloses.what],
    )  # fmt: skip


def follow(made: Surface, settings: Settings, *, finer: Surface | None = None) -> Stage[None]:
    """Refuse a mesh that is far from its window or its slices, or say so where that was allowed.

    Parameters
    ----------
    made : Surface
        As it is to be written.
    settings : Settings
    finer : Surface, optional
        With the faces that its way has made, where others were asked for: a mesh that is far for these alone is what
        was asked for, and only told of.

    Returns
    -------
    Stage
        Tells how far it is; a mesh that was let pass, or is not far from being refused, in words.

    Raises
    ------
    GeometryError
    """
    kind, found = _measured(made, settings.run.threads)
    if not found:
        return Stage(None)
    coarse = finer is not None and bool(_beyond(found, LIMITS[kind])) and not _is_far(finer, settings.run.threads)
    return _limited(kind, found, settings, coarse=coarse)


def follow_apart(followed: Followed, apart: Apart, settings: Settings) -> Stage[None]:
    """Refuse a mesh of which it was measured how far it is from what it is to follow; see `follow`."""
    return _limited(followed.what, _keys(apart, followed.unit), settings)


def _limited(kind: str, found: dict[str, float], settings: Settings, *, coarse: bool = False) -> Stage[None]:
    limits = LIMITS[kind]
    far, near = _beyond(found, limits), _beyond(found, limits.part(TOLD))
    what = "slices" if kind == "slices" else "window"
    if far and not (coarse or settings.run.allow_far):
        raise GeometryError(
            f"the mesh does not follow its {what}", found="; ".join(far), expected=limits.in_words(found),
            hint=ALLOW if kind in SURE else f"{OTHER_WAY}, or {ALLOW}",
        )  # fmt: skip
    mesh = "the mesh with faces so large" if coarse else "the mesh"
    told = f"{mesh} {'does not follow' if far else 'is far from'} its {what}: {'; '.join(near)}" if near else None
    stats = {"measure": kind, **found, **limits.keys(found), "far": told}
    return Stage(None, {"quality": {"follows": stats}}, () if told is None else (told,))


def _is_far(made: Surface, threads: int) -> bool:
    kind, found = _measured(made, threads)
    return bool(_beyond(found, LIMITS[kind]))


def _measured(made: Surface, threads: int) -> tuple[str, dict[str, float]]:
    """Return what a mesh is to follow, a key of `LIMITS`, and how far it is from that; nothing of other clouds."""
    if made.follows is not None:
        apart = made.follows.apart(made.mesh, leave_out=made.cap_faces if made.capped else None, threads=threads)
        return made.follows.what, _keys(apart, made.follows.unit)
    if made.encloses is not None and made.encloses.what == "slices":
        share = made.encloses.share(made.mesh)
        return "slices", {"volume_share": share if made.encloses.whole else min(share, 1.0)}
    return "", {}


def _keys(apart: Apart, unit: float) -> dict[str, float]:
    found = {"volume_share": apart.share, "offset_voxels": apart.offset, "unit_voxels": unit}
    for name, distances in (("mesh_to_window", apart.there), ("window_to_mesh", apart.back)):
        known = len(distances) > 0  # all of a mesh may be caps
        found[f"{name}_mean_voxels"] = float(distances.mean()) if known else 0.0
        found[f"{name}_p95_voxels"] = float(np.percentile(distances, 95)) if known else 0.0
    return found


def _beyond(found: dict[str, float], limits: Limits) -> list[str]:
    """Say in what a mesh is beyond some limits."""
    share, unit = found["volume_share"], found.get("unit_voxels", 1.0)
    off = abs(found.get("offset_voxels", np.inf)) > OFF * unit
    said = [f"{share:.0%} of the volume"] if off and not 1 / limits.volume <= share <= limits.volume else []
    for name, words, most in (
        ("mesh_to_window", "of it lie within {:.3g} voxels of the window", limits.there),
        ("window_to_mesh", "of the window within {:.3g} voxels of it", limits.back),
    ):
        within = found.get(f"{name}_p95_voxels", 0.0)
        said += [f"95 % {words.format(within)}"] if within > most * unit else []
    return said
