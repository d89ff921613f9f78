"""Even triangles in place of those that a way has left."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from ..errors import GeometryError, ResourceError
from ..measure.intersections import self_intersections
from ..measure.tree import Tree
from ..model.columns import any_of
from ..progress import Progress, silent
from .ground import EVEN, Ground, area_of, even_edge, usual_edge
from .rounds import AIM, ROUNDS, made_anew, made_even
from .specks import NOTHING, LeftOut, without_specks

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from ..model.mesh import TriMesh

    Marks = NDArray[np.bool_]

TRIES = 4
"""How often the surface is remeshed anew where faces pass through others, with what is under those kept as it was."""
REACH = 2
"""Rings of faces around such places that are kept too, on the mesh before."""
SPECK = 48
"""Faces that a component has at least, about, where no number was asked for: with fewer even ones it would lose its
shape."""
ROUND = 0.1
"""Roundness of such a component under which it is kept as it is: it is as flat as a leaf, and its two sides
would pass through each other."""
MOST_FACES = 40_000_000
"""Faces over which edges are refused as too short: they would take some 16 gigabytes."""
MORE = 1.3
"""Factor between the numbers of faces that are tried where fewer were asked for than can be: how much too large the one
may be that is named."""


@dataclass(frozen=True)
class Remeshed:
    """A mesh of even triangles.

    Attributes
    ----------
    mesh : TriMesh
    crossing : (m,) bool array
        Faces that pass through others.
    edge : float
        Length of the edge of an even triangle of the mean area of its faces.
    kept : int
        Vertices of the mesh before that are kept, as even triangles would pass through others there.
    before : TriMesh
        The mesh before, without what was left out.
    left_out : LeftOut
        Components too small for as few faces as were asked for.
    """

    mesh: TriMesh
    crossing: Marks
    edge: float
    kept: int
    before: TriMesh
    left_out: LeftOut = NOTHING

    @property
    def report(self) -> dict[str, Any]:
        """What is told of it."""
        return {
            "done": self.mesh is not self.before,
            "edge_mm": self.edge,
            "faces_before": len(self.before.faces),
            "kept_vertices": self.kept,
            "left_out_components": self.left_out.pieces,
            "left_out_share": self.left_out.share,
        }

    @property
    def warnings(self) -> tuple[str, ...]:
        """What must be known of it."""
        said = "the triangles are not even: even ones would pass through each other where sheets nearly touch"
        left = (self.left_out.told,) if self.left_out.pieces else ()
        return (*((said,) if self.mesh is self.before else ()), *left)


def remesh(
    mesh: TriMesh,
    *,
    edge: float | None = None,
    most: int | None = None,
    like: float = np.inf,
    crossing: Marks | None = None,
    threads: int = 0,
    progress: Progress = silent,
) -> Remeshed:
    """Replace the triangles of a mesh by even ones.

    Edges that are longer than they should be are split, shorter ones collapse, others are flipped where that makes
    angles larger, and vertices move evenly among their neighbors along the surface before, round after round (Botsch &
    Kobbelt 2004), with shorter edges where the surface bends (Dunyach et al. 2013). Borders stay; creases are kept.

    Parameters
    ----------
    mesh : TriMesh
        A manifold, closed or with borders.
    edge : float, optional
        Length of edges. Where it is not given, as many faces as there are now suffice.
    most : int, optional
        Most faces. Where there are more, components that are too small for so few are left out (`specks`).
    like : float
        Factor by which the volume may change at most.
    crossing : (m,) bool array, optional
        Faces that pass through others before, where that is known.
    threads : int
    progress : callable
        Told how far the stage ``remesh`` is.

    Returns
    -------
    Remeshed
        Of as many components and handles, and, where no number of faces is asked for, no more faces that pass through
        others.

    Raises
    ------
    GeometryError
        Where the shape cannot be kept with so few or so large faces; names a number that is enough.
    """
    _require_room(mesh, edge)
    whole, left_out = mesh, NOTHING
    if most is not None and most < len(mesh.faces):
        mesh, left_out = without_specks(mesh, most)
        crossing = None if left_out.pieces else crossing
    ground, best = _ground(mesh, edge, most, threads), None
    found, limit = np.zeros(len(mesh.vertices), np.bool_), most or (len(mesh.faces) if edge is None else np.inf)
    made, under, crosses = made_even(ground, found, limit, threads, progress)
    for tried in range(TRIES):
        if most is not None and len(made.faces) > most:
            break  # what is kept takes more faces still
        if best is None or crosses.sum() < best.crossing.sum():
            best = Remeshed(made, crosses, usual_edge(made, threads), int(found.sum()), mesh, left_out)
        if not crosses.any() or tried == TRIES - 1:
            break
        found = found | _under(ground, made, under, crosses)
        made, under, crosses = made_anew(ground, found, (made, under, crosses), limit, threads, progress)
    progress("remesh", ROUNDS, ROUNDS)
    if best is None or not _is_like(best.mesh, mesh, like):
        if most is None:
            raise _too_long(edge, share_of(made, mesh))
        raise _too_few(whole, most, made, like, threads, progress)
    if best.crossing.any() and (most is None or len(mesh.faces) <= most):
        crosses = self_intersections(mesh, threads=threads) if crossing is None else crossing
        if crosses.sum() < best.crossing.sum():
            return Remeshed(mesh, crosses, usual_edge(mesh, threads), len(mesh.vertices), mesh, left_out)
    return best


def share_of(made: TriMesh, before: TriMesh) -> float:
    """Return the volume of a mesh over that of the mesh before; 1 where that has none."""
    volume = float(before.face_volumes.sum())
    return float(made.face_volumes.sum()) / volume if volume > 0 else 1.0


def _is_like(made: TriMesh, before: TriMesh, like: float) -> bool:
    return bool(1 / like <= share_of(made, before) <= like) if np.isfinite(like) else True


def _too_few(mesh: TriMesh, most: int, made: TriMesh, like: float, threads: int, progress: Progress) -> GeometryError:
    """Return the refusal of so few faces, naming a number that was tried and is enough."""
    share, enough = share_of(made, mesh), max(len(made.faces), int(MORE * most))
    while enough < len(mesh.faces):
        kept, _ = without_specks(mesh, enough)
        found, _, _ = made_even(
            _ground(kept, None, enough, threads), np.zeros(len(kept.vertices), np.bool_), enough, threads, progress
        )
        if len(found.faces) <= enough and _is_like(found, kept, like):
            break
        enough = max(len(found.faces), int(MORE * enough))
    return GeometryError(
        "so few faces do not keep the shape, closed and with its handles",
        found=f"--target-faces = {most}, {len(made.faces)} faces with {share:.0%} of the volume",
        expected=f"{enough} or more",
        hint=f"--target-faces {enough}" + (", or --allow-far" if len(made.faces) <= most else ""),
    )  # fmt: skip


def _too_long(edge: float | None, share: float) -> GeometryError:
    """Return the refusal of edges so long that they lose the shape."""
    return GeometryError(
        "edges so long do not keep the shape", found=f"--edge = {edge}, {share:.0%} of the volume",
        hint="a shorter --edge, or --allow-far",
    )  # fmt: skip


def _require_room(mesh: TriMesh, edge: float | None) -> None:
    """Refuse edges so short that the faces would not fit into the memory.

    Raises
    ------
    ResourceError
        Naming how many faces there would be, and which edges would do.
    """
    area = area_of(mesh) if edge is not None else 0.0
    if edge is not None and area > MOST_FACES * EVEN * edge**2:
        raise ResourceError(
            "edges so short make too many faces", found=f"--edge = {edge:g}, {area / (EVEN * edge**2):.3g} faces",
            expected=f"at least {(area / (EVEN * MOST_FACES)) ** 0.5:.3g}, for {MOST_FACES} faces",
        )  # fmt: skip


def faces_under(made: TriMesh, before: TriMesh, threads: int = 0) -> NDArray[np.int32]:
    """Return the face of the mesh before that lies nearest to the middle of each face of another, (m,)."""
    return Tree.of_faces(before).nearest(made.corners.mean(axis=1), threads=threads)[1]


def _ground(mesh: TriMesh, edge: float | None, most: int | None, threads: int) -> Ground:
    """Look at the surface, and choose lengths of edges for as many faces as there are, or are asked for, at most."""
    area = area_of(mesh, threads)
    usual = edge or even_edge(area, min(len(mesh.faces), most or len(mesh.faces)))
    ground = Ground.of(mesh, usual, threads)
    if edge is not None and most is None:
        return ground.scaled(edge / even_edge(area, ground.forecast())).with_specks(SPECK, ROUND)
    fewest = min(len(mesh.faces), AIM * (most or np.inf))
    ground = ground.scaled((ground.forecast() / fewest) ** 0.5)
    return ground if most is not None else ground.with_specks(SPECK, ROUND)


def _under(ground: Ground, made: TriMesh, under: NDArray[np.int32], marked: Marks) -> Marks:
    """Mark the vertices (n,) of the mesh before under some faces (m,) and around them."""
    near = np.zeros(len(made.vertices), np.bool_)
    near[made.faces[marked]] = True
    near[made.faces[any_of(near[made.faces])]] = True
    found = np.zeros(len(ground.mesh.vertices), np.bool_)
    found[ground.faces[under[near]]] = True
    for _ in range(REACH):
        found[ground.faces[any_of(found[ground.faces])]] = True
    return found
