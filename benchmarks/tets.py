"""Tetrahedra inside of what every way writes at defaults, by TetGen and Gmsh: at first try, each in its own process.

Both are licensed otherwise than tomomesh and no part of it: ``pip install tetgen gmsh`` where this is run.
"""

from __future__ import annotations

import json
import subprocess
import sys
import tempfile
from importlib.metadata import version
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import trimesh

from bench import SHARED, at_least, header, holds, judge, note
from tomomesh import Volume, phantom, read_points, read_volume, reconstruct, reconstruct_points

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

    from tomomesh.model.mesh import TriMesh

PATIENCE = 600
"""Seconds that a mesher has for one mesh."""
RATIO = 1.5
"""Largest radius-edge ratio that TetGen is asked for."""
LABELS = "data/derived/dev54_synth_t1/dev54_synth_t1_labels.nii.gz"
CT = "data/dicom2stl/ct_example.nii.gz"
STACK = "data/clouds/contours/torus_sphere_5to1.xyz"
CLOUDS = {
    "bunny": "data/odedstein/bunny/bunny.obj",
    "fandisk": "data/common3d/fandisk.obj",
    "rocker-arm": "data/common3d/rocker-arm.obj",
}


def main() -> None:
    header("Tetrahedra inside of every way's mesh", "tetgen", "gmsh")
    note("versions", f"TetGen by tetgen {version('tetgen')}, Gmsh {version('gmsh')}")
    done = [judged(name, make()) for name, make in meshes().items()]
    holds(f"all {len(done)} meshes meshed by both at first try", all(done))


def meshes() -> dict[str, Callable[[], TriMesh]]:
    """Return what makes each mesh, by its name."""
    head = phantom()

    def of_head(**asked: Any) -> Callable[[], TriMesh]:
        return lambda: reconstruct(head.volume, lower=head.lower, upper=head.upper, **asked).mesh

    found = {"head, ring": of_head(), "head, voxels": of_head(network="none")}
    found |= {"head, loops": of_head(contours="loops"), "head, sphere": of_head(network="sphere")}
    if not SHARED.exists():
        return found
    found["ct, bone, voxels"] = lambda: reconstruct(read_volume(SHARED / CT), preset="bone", network="none").mesh
    found["ct, bone, loops"] = lambda: reconstruct(read_volume(SHARED / CT), preset="bone", contours="loops").mesh
    found["ventricles"] = lambda: of_labels((4, 43, 14, 15))
    found["skull"] = lambda: of_labels((515, 516))
    found["stack"] = lambda: reconstruct_points(read_points(SHARED / STACK)).mesh
    return found | {name: of_cloud(path) for name, path in CLOUDS.items()}


def of_labels(select: tuple[int, ...]) -> TriMesh:
    """Return the surface of some labels."""
    labels: Volume = read_volume(SHARED / LABELS)
    return reconstruct(labels, select=select, network="none").mesh


def of_cloud(path: str) -> Callable[[], TriMesh]:
    """Return what makes the mesh of 50,000 points of a surface."""
    draw = judge("cloud").cloud
    mesh = trimesh.load(SHARED / path, process=True, force="mesh")
    return lambda: reconstruct_points(draw(mesh, 50_000, 0.0, 7)).mesh


def judged(name: str, mesh: TriMesh) -> bool:
    """Have both mesh a surface, and say how good their tetrahedra are."""
    passed = True
    for mesher in ("tetgen", "gmsh"):
        found = meshed(mesher, mesh)
        passed &= "p1" in found
        if "p1" in found:
            figure = f"{name}, {len(mesh.faces)} faces, {mesher}: {found['count']:.0f} tetrahedra, 1 % of their angles"
            at_least(figure, float(found["p1"]), 10, "deg")
        else:
            note(f"{name}, {mesher}", f"failed: {found['failed']}")
    return passed


def meshed(mesher: str, mesh: TriMesh) -> dict[str, float | str]:
    """Run a mesher in a process of its own, which may crash or take too long."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "mesh.npz"
        np.savez(path, vertices=mesh.vertices, faces=mesh.faces)
        try:
            ran = subprocess.run(
                [sys.executable, __file__, mesher, str(path)], capture_output=True, text=True, timeout=PATIENCE
            )
        except subprocess.TimeoutExpired:
            return {"failed": f"no end within {PATIENCE} s"}
    lines = ran.stdout.strip().splitlines()
    told: dict[str, float | str] = json.loads(lines[-1]) if ran.returncode == 0 and lines else {}
    return told or {"failed": (ran.stderr.strip().splitlines() or [f"exit code {ran.returncode}"])[-1]}


def child(mesher: str, path: str) -> None:
    """Mesh one surface, and print how many tetrahedra there are and how small their dihedral angles."""
    surface = np.load(path)
    nodes, tetrahedra = {"tetgen": by_tetgen, "gmsh": by_gmsh}[mesher](surface["vertices"], surface["faces"])
    angles = dihedral(nodes[tetrahedra])
    print(json.dumps({"count": len(tetrahedra), "p1": float(np.percentile(angles, 1)), "least": float(angles.min())}))


def by_tetgen(vertices: NDArray[Any], faces: NDArray[Any]) -> tuple[NDArray[Any], NDArray[Any]]:
    """Return nodes and tetrahedra by TetGen."""
    import tetgen

    made = tetgen.TetGen(vertices, faces.astype(np.int32)).tetrahedralize(switches=f"pq{RATIO}Q")
    return made[0], made[1]


def by_gmsh(vertices: NDArray[Any], faces: NDArray[Any]) -> tuple[NDArray[Any], NDArray[Any]]:
    """Return nodes and tetrahedra by Gmsh."""
    import gmsh

    gmsh.initialize()
    gmsh.option.setNumber("General.Terminal", 0)
    surface = gmsh.model.addDiscreteEntity(2)
    gmsh.model.mesh.addNodes(2, surface, np.arange(1, len(vertices) + 1), vertices.ravel())
    gmsh.model.mesh.addElementsByType(surface, 2, [], faces.ravel() + 1)
    gmsh.model.geo.addVolume([gmsh.model.geo.addSurfaceLoop([surface])])
    gmsh.model.geo.synchronize()
    gmsh.model.mesh.generate(3)
    tags, places, _ = gmsh.model.mesh.getNodes()
    _, tetrahedra = gmsh.model.mesh.getElementsByType(4)
    number = np.empty(int(tags.max()) + 1, np.int64)
    number[tags] = np.arange(len(tags))
    return places.reshape(-1, 3), number[tetrahedra].reshape(-1, 4)


def dihedral(corners: NDArray[Any]) -> NDArray[Any]:
    """Return the six angles between the faces of each tetrahedron (t, 4, 3) in degrees, (t, 6)."""
    found = []
    for i, j, k, m in ((0, 1, 2, 3), (0, 2, 3, 1), (0, 3, 1, 2), (1, 2, 0, 3), (1, 3, 2, 0), (2, 3, 0, 1)):
        along = corners[:, j] - corners[:, i]
        one, other = (np.cross(along, corners[:, n] - corners[:, i]) for n in (k, m))
        size = np.linalg.norm(one, axis=1) * np.linalg.norm(other, axis=1)
        found.append(np.degrees(np.arccos(np.clip((one * other).sum(axis=1) / np.maximum(size, 1e-300), -1, 1))))
    return np.stack(found, axis=1)


if __name__ == "__main__":
    if len(sys.argv) == 3:
        child(*sys.argv[1:])
    else:
        main()
