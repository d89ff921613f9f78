"""Whether a result is good to use, in plain words, from its report alone."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping

GOOD, CARE, BAD = "good", "care", "bad"
"""How a check ended, the best first."""
SAID = {GOOD: "Good to use", CARE: "Use with care", BAD: "Not good to use"}
SEEN = 0.05
"""Voxels under which a distance is told as none. Only words depend on it."""
UNORIENTED = ("nonmanifold_edges", "nonmanifold_vertices", "misoriented_edges", "inward_components")
"""Counts that are 0 on a manifold that faces outward."""


@dataclass(frozen=True)
class Check:
    """One thing that was looked at.

    Attributes
    ----------
    state : str
        `GOOD`, `CARE` or `BAD`.
    label, text : str
        What was looked at, and what was found.
    """

    state: str
    label: str
    text: str


@dataclass(frozen=True)
class Verdict:
    """What all checks come to.

    Attributes
    ----------
    checks : tuple of Check
    """

    checks: tuple[Check, ...]

    @property
    def state(self) -> str:
        """The worst of its checks."""
        return max((check.state for check in self.checks), key=(GOOD, CARE, BAD).index, default=CARE)

    @property
    def words(self) -> str:
        """Say it in one sentence."""
        told = [check.text for check in self.checks if check.state == self.state]
        return f"{SAID[self.state]}: {', '.join(told)}." if told else f"{SAID[self.state]}."


def verdict_of(report: Mapping[str, Any]) -> Verdict:
    """Judge a report of ``reconstruct``, ``surface``, ``check`` or ``print``.

    Parameters
    ----------
    report : mapping

    Returns
    -------
    Verdict
    """
    quality = report.get("quality") or (report if "sound" in report else report.get("print", {}))
    sheet = report.get("way", {}).get("name") == "sheet"
    return Verdict((*_of_shape(quality, sheet), *_of_data(report), *_of_fit(report), *_of_print(report)))


def _of_shape(quality: Mapping[str, Any], sheet: bool) -> Iterator[Check]:
    """Judge the mesh by itself; of a part to print only whether it is sound is told."""
    if "boundary_edges" not in quality:
        sound = bool(quality.get("sound"))
        text = "the mesh is closed and manifold" if sound else "the mesh is not closed and manifold"
        yield Check(GOOD if sound else BAD, "Closed and manifold", text)
    else:
        yield _closed(int(quality["boundary_edges"]), sheet)
        manifold = not any(quality[name] for name in UNORIENTED)
        text = "it is manifold and faces outward" if manifold else "it is not manifold, or does not face outward"
        yield Check(GOOD if manifold else BAD, "Manifold", text)
    crossing = quality.get("self_intersections", 0)
    text = f"{crossing} face(s) pass through others" if crossing else "no face passes through another"
    yield Check(BAD if crossing else GOOD, "No self-crossing", text)


def _closed(open_edges: int, sheet: bool) -> Check:
    if open_edges and sheet:
        return Check(GOOD, "Closed", "the mesh is a sheet with borders, as its way makes it")
    text = f"the mesh is open along {open_edges} edges" if open_edges else "the mesh is closed"
    return Check(BAD if open_edges else GOOD, "Closed", text)


def _of_data(report: Mapping[str, Any]) -> Iterator[Check]:
    """Judge whether it follows what it was made from, where that was measured."""
    quality = report.get("quality", {})
    follows, unit = quality.get("follows", {}), report.get("points", {}).get("unit", "mm")
    if follows:
        far = follows.get("far")
        yield Check(BAD if far else GOOD, "Follows its data", far or _near(follows))
    elif "points_to_surface_p95_mm" in quality:
        text = f"95 % of the points lie within {quality['points_to_surface_p95_mm']:.3g} {unit} of it"
        yield Check(GOOD, "Follows its data", text)
    if report.get("dice") is not None:
        yield Check(GOOD, "Against the other", f"its Dice coefficient is {report['dice']:.4f}")


def _near(follows: Mapping[str, Any]) -> str:
    near = follows.get("mesh_to_window_p95_voxels")
    if near is None:
        return f"it encloses {follows['volume_share']:.0%} of the volume of its slices"
    return f"95 % of it lie within {near:.2g} voxels of the window" if near > SEEN else "it lies in the window's voxels"


def _of_fit(report: Mapping[str, Any]) -> Iterator[Check]:
    rests = report.get("fit", {}).get("converged")
    if rests is not None:
        yield Check(GOOD if rests else CARE, "At rest", "the fit is at rest" if rests else "the fit is not at rest")
    warnings = len(report.get("warnings", ()))
    if warnings:
        yield Check(CARE, "Warnings", f"there {'is a warning' if warnings == 1 else f'are {warnings} warnings'}")


def _of_print(report: Mapping[str, Any]) -> Iterator[Check]:
    told = report.get("print")
    if told is not None:
        text = "it can be printed" if told["printable"] else f"it cannot be printed: {'; '.join(told['reasons'])}"
        yield Check(GOOD if told["printable"] else BAD, "Printable", text)
