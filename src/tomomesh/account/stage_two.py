"""The account of stages two and three: points, cubes, surface, fit."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ..model.points import BRIDGE, CAP, NEURON
from .ledger import Ledger

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from ..contours.slices import Slices
    from ..contours.stack import ContourSurface
    from ..cuberille.leak_test import Held
    from ..dynamics.moving_least_squares import SurfaceFit
    from ..isosurface.voxels import Boundary, VoxelSurface
    from ..model.mesh import TriMesh
    from ..model.points import PointSet
    from ..model.trace import Trace
    from ..pointcloud.samples import Samples

DRAWN = 0.9
"""Share of the vertices that must have a point near them, else a result is warned of."""
STRAYS = 0.05
"""Share of strays among the points over which a result is warned of."""
WIDE = 3
"""Closing over which a result is warned of, cubes."""
FILLED = 0.05
"""Share of filled faces over which a result is warned of."""
APART = 1.5
"""Distance of two slices of a stack of contours, in median ones, over which a result is warned of."""


class StageTwo(Ledger):
    """What the points are, what surface they were given, and how its mesh came to rest."""

    @property
    def cavities(self) -> int:
        """The surfaces taken that line a cavity."""
        return int(self._sections["surface"]["cavities"])

    @property
    def cell_mm(self) -> float:
        """The smallest edge of the cubes."""
        return float(min(self._sections["cubes"]["cell_mm"]))

    def points(self, points: PointSet, spacing: float, bridged: int = 0) -> None:
        """Note how many points there are and how far apart."""
        self._sections["points"] = {
            "unit": "mm" if "study" in self._sections else self._settings.run.units,
            "count": len(points),
            "measured": int((points.kinds == NEURON).sum()),
            "on_bridges": int((points.kinds == BRIDGE).sum()),
            "on_caps": int((points.kinds == CAP).sum()),
            "bridged_gaps": bridged,
            "spacing_mm": spacing,
        }

    def cloud(self, cloud: PointSet, lowest: NDArray[np.float64]) -> None:
        """Note where the lowest corner of a cloud is, and what its reader says of it."""
        known = {"origin": lowest.tolist(), "frame": cloud.frame, "notes": list(cloud.notes)}
        self._sections["points"] |= known

    def samples(self, count: int, samples: Samples) -> None:
        """Note how far apart the points of a cloud are, how noisy, and how many are strays."""
        spacing, noise = float(np.median(samples.spacing)), float(np.median(samples.noise))
        self._sections["points"] = {
            "unit": self._settings.run.units,
            "count": count,
            "distinct": len(samples.positions) + samples.strays,
            "strays": samples.strays,
            "spacing_mm": spacing,
            "spacing_p5_mm": float(np.percentile(samples.spacing, 5)),
            "spacing_p95_mm": float(np.percentile(samples.spacing, 95)),
            "noise_mm": noise,
            "noise_p95_mm": float(np.percentile(samples.noise, 95)),
        }
        if samples.strays > STRAYS * count:
            self.warn(f"{samples.strays} of {count} points are strays, and were left out")

    def held(
        self, held: Held, taken: NDArray[np.bool_], cell: NDArray[np.float64], cubes: int, bridged: int = 0
    ) -> None:
        """Note the cubes, the closing that made them hold, and which surfaces were taken."""
        shell, walls = held.shell, held.walls
        self._sections["cubes"] = {
            "cell_mm": cell.tolist(),
            "occupied": cubes,
            "bridge_places": bridged,
            "closing": shell.closing,
            "added_for_composition": shell.added,
            "two_sided": held.two_sided,
            "holds": held.holds,
        }
        self._sections["surface"] = {
            "found": walls.count,
            "cavities": int((walls.inward & taken).sum()),
            "taken": int(taken.sum()),
            "debris": int(walls.debris.sum()),
            "square_faces": int(walls.sizes[taken].sum()),
            "enclosed_cubes": int(walls.volumes[taken].sum()),
        }
        if held.holds and shell.closing > WIDE:
            self.warn(f"gaps up to {2 * shell.closing} cubes wide were closed: the surface is made up there")

    def unfitted(self, *, flat: bool) -> None:
        """Warn of a shell that does not hold and was let pass: both its walls would rest on the same points."""
        self.warn(
            "the points lie in a plane, on a line or at one place: their shell is smoothed, but not fitted"
            if flat
            else "the outside leaks into the shell: its surface has two walls, and is smoothed, but not fitted"
        )

    def fitted(self, fitted: SurfaceFit | None, taken_back: int, filled: NDArray[np.bool_]) -> None:
        """Note how the mesh of a cloud came to rest, and what of it was filled rather than measured."""
        if fitted is None:
            self._sections["fit"] = {"iterations": 0, "converged": True, "collapsed": 0}
        else:
            self.fit(fitted.trace, len(fitted.vertices), 0)
        self._sections["fit"] |= {"taken_back": taken_back, "filled_faces": int(filled.sum())}
        if filled.mean() > FILLED:
            self.warn(f"{filled.mean():.0%} of the faces lie where there are no points: they were filled")

    def fit(self, trace: Trace, vertices: int, collapsed: int) -> None:
        """Note how the mesh came to rest, and how many components were not left as the fit had them."""
        steps = len(trace.speed)
        self._sections["fit"] = {"iterations": steps, "converged": trace.converged, "collapsed": collapsed}
        if collapsed:
            self.warn(f"{collapsed} component(s) collapsed in the fit: they are smoothed, but not fitted")
        if steps:
            self._sections["fit"] |= {
                "speed": float(trace.speed[-1]),
                "acceleration": float(trace.acceleration[-1]),
                "first_distance_mm": float(trace.distance_mm[0]),
                "last_distance_mm": float(trace.distance_mm[-1]),
                "clamped": int(trace.clamped.sum()),
                "unattracted": int(trace.unattracted[-1]),
            }
            drawn = 1 - trace.unattracted[-1] / max(vertices, 1)
            if drawn < DRAWN:
                self.warn(f"{1 - drawn:.0%} of the vertices have no point near: the cubes are small for the points")
        if steps and not trace.converged:
            self.warn(f"the mesh had not come to rest after {steps} steps")

    def faces(self, network: TriMesh, squares: int, untangled: int) -> None:
        """Note the faces of a network in space, and the finer squares that they were divided into."""
        self._sections["space"] |= {"faces": len(network.faces), "untangled": untangled}
        self._sections["surface"] = {
            "found": 1,
            "cavities": 0,
            "taken": 1,
            "debris": 0,
            "square_faces": squares,
            "enclosed_cubes": 0,
        }

    def rested(self, trace: Trace, vertices: int, taken_back: int, filled: NDArray[np.bool_]) -> None:
        """Note how a network's own faces came to rest, and where there was nothing to rest on."""
        self.fit(trace, vertices, 0)
        self._sections["fit"] |= {"taken_back": taken_back, "filled_faces": int(filled.sum())}
        if not len(trace.speed):
            self._sections["fit"]["converged"] = True

    def boundary(self, found: Boundary, surface: VoxelSurface) -> None:
        """Note the boundary of the voxels, and how its net came to rest."""
        trace, steps = surface.net_fit.trace, len(surface.net_fit.trace.speed)
        self._sections["voxels"] = {
            "added_for_composition": found.added,
            "interpolated": not found.crossings.stepped,
            "split_in_four": len(surface.mesh.vertices) - len(found.net.low),
        }
        self._sections["surface"] = {
            "found": len(found.volumes),
            "cavities": found.cavities,
            "taken": len(found.volumes),
            "debris": 0,
            "square_faces": len(found.net.quads),
            "enclosed_cubes": int(found.volumes.sum()),
        }
        self._sections["fit"] = {"iterations": steps, "converged": trace.converged, "collapsed": 0}
        if steps:
            self._sections["fit"] |= {"speed": float(trace.speed[-1]), "acceleration": float(trace.acceleration[-1])}
        if found.crossings.stepped:
            self.warn("the gray levels are those of a mask: the surface is evened out between the voxels")
        elif steps and not trace.converged:
            self.warn(f"the mesh had not come to rest after {steps} steps")

    def stack(self, made: ContourSurface, slices: Slices) -> None:
        """Note the slices of a stack of contours, and the voxels between them."""
        widest = float(np.diff(slices.heights).max())
        self._sections["stack"] = {
            "slices": made.slices,
            "contours": made.contours,
            "open": made.open,
            "slice_distance_mm": slices.distance,
            "widest_slice_distance_mm": widest,
            "longest_gap": made.reach,
            "voxel_mm": made.edge,
            "voxels": made.voxels,
        }
        self._sections["fit"]["filled_faces"] = int(made.filled.sum())
        if "study" not in self._sections and widest > APART * slices.distance:
            self.warn(f"slices lie up to {widest:.4g} apart, {slices.distance:.4g} as a rule: that is interpolated")
        if made.edge > made.asked_edge:
            self.warn(f"voxels of {made.asked_edge:.4g} would not fit: they are {made.edge:.4g} wide")

    def decimated(self, filled: NDArray[np.bool_] | None) -> None:
        """Count the filled faces of the coarser mesh."""
        if filled is not None:
            self._sections["fit"]["filled_faces"] = int(filled.sum())
