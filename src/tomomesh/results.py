"""What the stages hand back."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING, Any, Generic, TypeVar

import numpy as np

from .isosurface.run_mask import RunMask
from .measure.tree import Tree
from .model.columns import any_of
from .model.mesh import QuadMesh
from .model.points import CAP
from .report import Reported

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

    from .followed import Followed
    from .html.inline import Shown
    from .isosurface.crossings import Levels
    from .model.cubes import CubeGrid
    from .model.mesh import TriMesh
    from .model.points import PointSet
    from .model.trace import Trace
    from .model.volume import Volume
    from .printing.part import Part
    from .segmentation.sample import Sampling
    from .show.render import View

    Regions = NDArray[np.unsignedinteger[Any]]
    Layer = tuple[Any, dict[str, Any], str]

S = TypeVar("S")

LEAST = 0.5
"""Share of the volume that its rings, its window or its samples enclose, below which a mesh counts as two-walled.
Measured: 1.5 to 6.5 % where the outside leaked in, 69 % for the worst of one wall (`--paper`, a head)."""


@dataclass(frozen=True)
class Segmentation(Reported, Generic[S]):
    """A study after stage one.

    Attributes
    ----------
    volume : Volume
        The study, its slices along K.
    plane : str
        Of the slices: axial, coronal or sagittal.
    runs : RunMask
        The window.
    regions : (K, J, I) uint8 or uint16 array, or callable
        The labels, or what finds them.
    points : PointSet
        The neurons, bridged gaps and caps in patient millimeters.
    sampling : Sampling
    source : Networks, Contours, SpaceFound or Boundary
        What the points were taken from: one network a slice, several, one in space, or the window's own boundary.
    levels : Levels or None
        The gray levels and the window on them, where a way goes on by them.
    """

    volume: Volume
    plane: str
    runs: RunMask
    regions: Regions | Callable[[], Regions]
    points: PointSet
    sampling: Sampling
    source: S
    levels: Levels | None = None

    @property
    def mask(self) -> NDArray[np.bool_]:
        """The window, (K, J, I), all in memory."""
        return self.runs.dense

    @cached_property
    def labels(self) -> Regions:
        """Every window pixel's winner, (K, J, I): 0 background, neuron + 1 within its slice; found on first use."""
        return self.regions() if callable(self.regions) else self.regions

    def __repr__(self) -> str:
        return f"Segmentation({self.way or 'no way'}, {len(self.points.positions):,} points of {self.volume!r})"

    def _shown(self) -> Shown:
        from .html.inline import MOST, Shown
        from .html.pictures import smaller
        from .html.scene import scene_of_points
        from .show.drawing.page import png
        from .show.space import draw_points

        facts = [("way", self.way), ("study", repr(self.volume)), ("plane", self.plane)]
        words = f"{self.runs.count:,} voxels are kept, and {len(self.points.positions):,} points lie on them."
        still, _ = smaller("07-points", png(draw_points(self.points)))
        return Shown("Segmentation", words, facts, scene_of_points(self.points.positions, most=MOST), still=still)

    def without_voxels(self) -> Segmentation[S]:
        """Return the same without the study's voxels, where its way does not go on by them."""
        return self if self.levels is not None else replace(self, volume=self.volume.bare())

    def bare(self) -> Segmentation[Any]:
        """Return the same without all that no step after its surface needs: it is only shown, or written."""
        none = np.broadcast_to(np.uint8(0), self.runs.shape)
        every: Segmentation[Any] = self
        return replace(
            every, volume=self.volume.bare(), runs=RunMask.none(self.runs.shape), regions=none, source=None, levels=None
        )  # fmt: skip


@dataclass(frozen=True)
class Enclosed:
    """What a mesh should enclose, at least: the volume inside its rings, its slices, its samples or its window."""

    what: str
    volume: float
    whole: bool = True
    """Whether it is all that a mesh should enclose."""

    @classmethod
    def window(cls, found: Segmentation[Any]) -> Enclosed:
        """Return the volume of the voxels of a window, mm^3."""
        return cls("window", found.runs.count * found.volume.voxel_mm3)

    def or_more(self, other: Enclosed) -> Enclosed:
        """Return the larger of two."""
        return max(self, other, key=lambda one: one.volume)

    def share(self, mesh: TriMesh) -> float:
        """Return how much of it a mesh encloses; 1 where there is nothing to enclose."""
        return float(mesh.face_volumes.sum()) / self.volume if self.volume > 0 else 1.0


@dataclass(frozen=True)
class Place:
    """What the numbers of a cloud are: their unit, their frame, and the corner that they are counted from."""

    unit: str
    frame: str
    origin: tuple[float, ...]
    local: bool

    @property
    def name(self) -> str:
        """The frame as a file names it."""
        corner = ",".join(repr(axis).removesuffix(".0") for axis in self.origin)
        return f"local:{corner}" if self.local else self.frame

    @property
    def words(self) -> str:
        """What its numbers are."""
        return f"{'of an unknown unit' if self.unit == 'unknown' else self.unit}, as in the points"


@dataclass(frozen=True)
class Surface(Reported):
    """A surface after stages two and three; every stage is kept.

    Attributes
    ----------
    points : PointSet
    cuberille : QuadMesh
    smoothed, mesh : TriMesh
        The surface before and after the fit, with the same faces unless `mesh` was remeshed.
    nearest : (n,) int32 array
        The point that draws each vertex of `mesh`, -1 where there is none; empty for clouds and remeshed meshes.
    cubes : CubeGrid or None
        The cubes that hold the points, on ways that go by them.
    trace : Trace or None
        The history of the fit, where masses moved.
    filled : (m,) bool array or None
        Faces of `mesh` that lie where a cloud has no points: filled, not measured.
    cut_off : (m,) bool array or None
        Faces of `mesh` over which the study is cut off, where that is known of each; else caps are found by points.
    cavities : int
        Components of `mesh` that line a cavity.
    borders : bool
        Whether it is a sheet with borders.
    crossing : (m,) bool array or None
        Faces that pass through others, where that is known.
    rests_on : (p, 3) float array or None
        The places that distances are measured from, where these are not the points.
    encloses : Enclosed or None
        What it should enclose; None where its way tells nothing of it, or where two walls were allowed.
    follows : Followed or None
        What of a window it is to follow; None for clouds, and where two walls were allowed.
    segmentation : Segmentation or None
        Stage one, where the points came from a study.
    place : Place or None
        Unit and frame, where the points were a cloud.
    part : Part or None
        What is written in place of `mesh`, where printing was asked for.
    """

    points: PointSet
    cuberille: QuadMesh
    smoothed: TriMesh
    mesh: TriMesh
    nearest: NDArray[np.int32]
    cubes: CubeGrid | None = None
    trace: Trace | None = None
    filled: NDArray[np.bool_] | None = None
    cut_off: NDArray[np.bool_] | None = None
    cavities: int = 0
    borders: bool = False
    crossing: NDArray[np.bool_] | None = None
    rests_on: NDArray[np.float64] | None = None
    encloses: Enclosed | None = None
    follows: Followed | None = None
    segmentation: Segmentation[Any] | None = None
    place: Place | None = None
    part: Part | None = None

    def __repr__(self) -> str:
        mesh = self.mesh
        return f"Surface({self.way or 'no way'}, {len(mesh.faces):,} faces, {len(mesh.vertices):,} vertices)"

    def to_napari_layers(self) -> list[Layer]:
        """Return what napari draws, as its layer data tuples, which its layers are created from.

        Returns
        -------
        list of (data, options, kind)
            The study's voxels, where they are in memory, with the affine that places them; the points; the mesh. All
            axes are in napari's order: z, y, x, in millimeters of the patient (LPS), or as the cloud's.
        """
        found = self.segmentation
        points = (self.points.positions[:, ::-1].copy(), {"name": "points", "size": self._spacing}, "points")
        surface = ((self.mesh.vertices[:, ::-1].copy(), self.mesh.faces.copy()), {"name": "mesh"}, "surface")
        return [*([] if found is None else _image_of(found.volume)), points, surface]

    @property
    def _spacing(self) -> float:
        """The narrowest spacing of the study's voxels, or half of the mean edge of the mesh."""
        if self.segmentation is not None:
            return min(self.segmentation.volume.spacing_mm)
        a, b = self.mesh.vertices[self.mesh.edges.T]
        return float(np.linalg.norm(a - b, axis=1).mean() / 2) if len(a) else 1.0

    def _shown(self) -> Shown:
        from .html.inline import MOST
        from .html.pictures import SHADED, smaller
        from .html.scene import PATIENT, PLAIN, scene_of_mesh
        from .show.drawing.page import png
        from .show.space import draw_shaded

        mesh, unit, axes, told = self.mesh, "mm", PATIENT, super()._shown()
        if self.part is not None:
            mesh, told = self.part.mesh, replace(told, frame="millimeters of the part to print")
        elif self.place is not None:
            unit, axes, told = self.place.unit, PLAIN, replace(told, frame=self.place.words)
        still, _ = smaller(SHADED, png(draw_shaded(mesh, self.view)))
        return replace(told, scene=scene_of_mesh(mesh, most=MOST, unit=unit, axes=axes), still=still)

    @property
    def view(self) -> View:
        """How pictures look at it: the axes are the patient's where there is one, plain ones for a cloud."""
        from .show.render import View

        return View() if self.place is None else View(unit=self.place.unit, axes=("x", "y", "z"))

    def bare(self) -> Surface:
        """Return the same without what is only shown of how it came about."""
        none = QuadMesh(np.empty((0, 3)), np.empty((0, 4), np.int64))
        return replace(self, cuberille=none, smoothed=self.mesh, nearest=np.empty(0, np.int32), trace=None)

    @property
    def capped(self) -> bool:
        """Whether any of its points are on a cap."""
        return bool((self.points.kinds == CAP).any())

    @property
    def cap_faces(self) -> NDArray[np.bool_]:
        """Faces (m,) that were filled, not measured: as known of each, or with a corner that is nearest to a cap."""
        if self.cut_off is not None:
            return self.cut_off
        if not self.capped:
            return np.zeros(len(self.mesh.faces), np.bool_)
        _, nearest = Tree.of_points(self.points.positions).nearest(self.mesh.vertices)
        on_cap = self.points.kinds[nearest] == CAP
        return any_of(on_cap[self.mesh.faces])


def _image_of(volume: Volume) -> list[Layer]:
    """Return a study as a layer of napari's; none where its voxels were given up or stay in their file."""
    if volume.in_parts is not None or not any(volume.voxels.strides):
        return []
    affine = volume.affine[np.ix_([2, 1, 0, 3], [2, 1, 0, 3])]
    return [(volume.voxels, {"name": "study", "affine": affine, "rgb": volume.layers > 1}, "image")]
