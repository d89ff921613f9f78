"""The report: what all stages of a run found, in the order of docs/report.md."""

from __future__ import annotations

import platform
from dataclasses import dataclass, field
from functools import cache, cached_property
from importlib.metadata import version
from typing import TYPE_CHECKING, Any

from .settings import Settings
from .stage import Later, Stage, folded

if TYPE_CHECKING:
    from .html.inline import Shown

BEFORE = ("way", "study", "window", "networks", "rings", "points", "cubes", "stack", "voxels", "space")
AFTER = ("surface", "fit", "smooth", "remesh", "quality", "written", "mask", "print", "truth")
"""Sections in their order; what a way has of its own stands between the two."""
PACKAGES = ("tomomesh", "numpy", "scipy", "numba")
"""What the result depends on."""


@dataclass(frozen=True)
class Reported:
    """A result that can tell how it came about.

    Attributes
    ----------
    way : str
        A name of `tomomesh.ways.WAYS`.
    settings : Settings
    stages : tuple of Stage
        In their order; what is measured only for the report is made when that is first read.
    """

    way: str = field(default="", repr=False, kw_only=True)
    settings: Settings = field(default_factory=Settings, repr=False, kw_only=True)
    stages: tuple[Stage[Any] | Later, ...] = field(default=(), repr=False, kw_only=True)

    @cached_property
    def report(self) -> dict[str, Any]:
        """What the stages found and how good the result is, key by key in docs/report.md; measured on first use."""
        return report_of(self.stages, self.settings)

    def _repr_html_(self) -> str:
        """Show it in a notebook."""
        from .html.inline import inline

        return inline(self._shown())

    def _repr_markdown_(self) -> str:
        """Show it on paper, made of a notebook."""
        from .html.inline import in_markdown

        return in_markdown(self._shown())

    def _shown(self) -> Shown:
        """Return what is told of it: here its verdict and first facts."""
        from .html.inline import Shown, facts_of
        from .html.verdict import verdict_of

        unit = self.report.get("points", {}).get("unit", "mm")
        return Shown("Surface", verdict_of(self.report).words, facts_of(self.report, unit))


def report_of(stages: tuple[Stage[Any] | Later, ...], settings: Settings) -> dict[str, Any]:
    """Fold stages into a report.

    Parameters
    ----------
    stages : tuple of Stage, or of functions that make one
    settings : Settings
        Those of the run.

    Returns
    -------
    dict
        Sections in the order of docs/report.md.
    """
    found = folded(None, *(stage if isinstance(stage, Stage) else stage() for stage in stages))
    seconds = {f"{name}_s": spent for name, spent in found.seconds.items()}
    own = [name for name in found.stats if name not in BEFORE + AFTER]
    told = {name: dict(found.stats[name]) for name in (*BEFORE, *own, *AFTER) if name in found.stats}
    return told | {
        "timings": seconds | {"total_s": sum(seconds.values())},
        "settings": settings.to_dict(),
        "versions": dict(versions()),
        "warnings": list(found.warnings),
    }


@cache
def versions() -> dict[str, str]:
    """Return the versions of what the result depends on."""
    return {name: version(name) for name in PACKAGES} | {"python": platform.python_version()}
