"""Keep the account of a run: what each stage found, how long it took, and how good the mesh is."""

from __future__ import annotations

import platform
from functools import cache, partial
from importlib.metadata import version
from typing import TYPE_CHECKING, Any

from ..measure.report import assess, compare
from ..progress import Progress, silent
from .stage_one import StageOne
from .stage_two import StageTwo

if TYPE_CHECKING:
    from collections.abc import Callable

    import numpy as np
    from numpy.typing import NDArray

    from ..model.mesh import TriMesh
    from ..model.points import PointSet
    from ..segmentation.sample import Sampling
    from ..settings import Settings

SECTIONS = (
    "study", "window", "networks", "rings", "points", "cubes", "surface", "fit", "quality", "truth", "timings",
    "settings", "versions", "warnings",
)  # fmt: skip
ORDER = (
    *SECTIONS[: SECTIONS.index("surface")], "stack", "voxels", "space", "surface", "fit", "quality", "print",
    *SECTIONS[SECTIONS.index("truth") :],
)  # fmt: skip
"""The same, what stands in place of cubes (the stack of contours, the voxels, and the network in space), and the part
to print."""
PLAUSIBLE = 0.15
"""Difference from the volume of the rings over which a result is warned of."""
FAR = 2.0
"""Distance of the surface from one point in twenty, slice distances, from which a result is warned of."""
PACKAGES = ("tomomesh", "numpy", "scipy", "numba")


class Account(StageOne, StageTwo):
    """The report in the making; one method a section, each documented key by key in docs/report.md."""

    def __init__(self, settings: Settings) -> None:
        super().__init__(settings)
        self._measure: Callable[[], dict[str, Any]] | None = None
        self._judge: Callable[[], dict[str, Any]] | None = None
        self._rings_mm3 = 0.0

    def quality(
        self,
        mesh: TriMesh,
        points: PointSet,
        cavities: int,
        progress: Progress = silent,
        crossing: NDArray[np.bool_] | None = None,
    ) -> None:
        """Have the mesh measured, against its points too, once the report is asked for."""
        self._measure = partial(
            assess, mesh, points=points.positions, cavities=cavities, crossing=crossing,
            threads=self._settings.run.threads, progress=progress,
        )  # fmt: skip

    def printed(self, judge: Callable[[], dict[str, Any]]) -> None:
        """Have it told whether the part can be printed, once the report is asked for."""
        self._judge = judge

    def volume(self, sampling: Sampling) -> None:
        """Have the volume of the mesh compared with the areas of the rings times the distance of their slices."""
        self._rings_mm3 = sampling.volume_mm3

    def truth(self, mesh: TriMesh, caps: NDArray[np.bool_], truth: TriMesh) -> None:
        """Measure the distance to the exact surface, both ways; the caps are no part of it."""
        with self.timed("truth"):
            self._sections["truth"] = compare(mesh, truth, leave_out=caps)

    def report(self) -> dict[str, Any]:
        """Return the report, its sections in their documented order; measures the mesh the first time."""
        self._measured()
        self._judged()
        sections: dict[str, Any] = self._sections | {
            "timings": self._timings | {"total_s": sum(self._timings.values())},
            "settings": self._settings.to_dict(),
            "versions": dict(versions()),
            "warnings": list(self._warnings),
        }
        return {name: sections[name] for name in ORDER if name in sections}

    def _measured(self) -> None:
        """Measure the mesh, where there is one that has not been."""
        if self._measure is None:
            return
        with self.timed("quality"):
            quality = self._sections["quality"] = self._measure()
        self._measure = None
        if self._rings_mm3 > 0:
            quality["rings_volume_mm3"] = self._rings_mm3
            quality["volume_over_rings"] = quality["volume_mm3"] / self._rings_mm3
            if abs(quality["volume_over_rings"] - 1) > PLAUSIBLE:
                self.warn(f"the mesh encloses {quality['volume_over_rings']:.0%} of the volume of its rings")
        far = quality.get("points_to_surface_p95_mm", 0.0)
        if "study" in self._sections and far > FAR * self._sections["study"]["slice_spacing_mm"]:
            self.warn(
                f"one point in twenty lies over {far:.3g} mm from the surface: it does not follow the window there, "
                "as --network none and --contours loops do"
            )
        if quality["self_intersections"]:
            self.warn(f"{quality['self_intersections']} faces pass through others")

    def _judged(self) -> None:
        """Tell whether the part can be printed, where there is one that has not been looked at."""
        if self._judge is not None:
            with self.timed("print"):
                self._sections["print"] = self._judge()
            self._judge = None


@cache
def versions() -> dict[str, str]:
    """Return the versions of what the result depends on."""
    return {name: version(name) for name in PACKAGES} | {"python": platform.python_version()}
