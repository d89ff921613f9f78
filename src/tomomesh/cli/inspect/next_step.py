"""The command that `tomomesh inspect` suggests."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from ...settings import Settings

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from ...errors import TomomeshError
    from ...io import Series

VALUES = {"--spacing": "X Y Z", "--spacing-z": "MM"}
"""What stands for the values that only the user knows."""
SERIES, SELECT = "--series", "--select"


def next_step(
    found: dict[str, Any], study: str, settings: Settings, fault: TomomeshError | None, series: Sequence[Series]
) -> str | None:
    """Return the command that goes on: a first mesh, or `inspect` with the flag that helps; None where none does.

    Parameters
    ----------
    found : dict
        As `inspected` returns it.
    study : str
        Its words on a command line.
    settings : Settings
        Those given; the command repeats them.
    fault : TomomeshError or None
        What refuses the study.
    series : sequence of Series
        Those to choose from.
    """
    given = settings.words()
    if fault is None:
        first = Settings().replace(**first_try(found)).words()
        named = f"--labels-in {study}" if found["labels"] else study
        return " ".join(["tomomesh reconstruct", named, *first, *given, "-o mesh.stl"])
    if SELECT in fault.flags:
        chosen = f"--labels-in {study} {SELECT} {min(found['segments'], default='N')}"
        return " ".join(["tomomesh reconstruct", chosen, *given, "-o mesh.stl"])
    helping = list(_helping(fault, series))
    return " ".join(["tomomesh inspect", study, *given, *helping]) if helping else None


def first_try(found: dict[str, Any]) -> dict[str, Any]:
    """Return the window of a first mesh: the largest label, bone, or nothing for Otsu's."""
    labels = found["labels"]
    if labels:
        return {"select": (int(max(labels, key=lambda label: labels[label])),)}
    bone = found["windows"].get("bone", {"share": 0})
    return {"preset": "bone"} if bone["share"] else {}


def _helping(fault: TomomeshError, series: Sequence[Series]) -> Iterator[str]:
    """Yield the flags that a refusal names; for a choice of series, the best one's number and what it needs."""
    flags = [*fault.flags]
    if SERIES in flags:
        best = max(series, key=_promise)
        yield f"{SERIES} {best.number}"
        flags += best.refused.flags if best.refused else ()
    for flag in dict.fromkeys(flags):
        if flag != SERIES:
            yield f"{flag} {VALUES[flag]}" if flag in VALUES else flag


def _promise(series: Series) -> tuple[bool, int, int]:
    """Rank series: those that can be read, or that a flag helps, then by their slices, the first of equals."""
    return series.refused is None or bool(series.refused.flags), series.slices, -series.number
