"""Pictures: what `--figures` adds to a whole process, and two million faces drawn beside VTK and a painter."""

from __future__ import annotations

import contextlib
import importlib.util
import io
import subprocess
import sys
import tempfile
from typing import TYPE_CHECKING

import numpy as np

from bench import at_most, costs, note, race

if TYPE_CHECKING:
    from collections.abc import Callable

    from tomomesh.model.mesh import TriMesh

RUNS = 3
SIDE = 1000
"""Squares of the torus along and across: two triangles each."""


def figures() -> None:
    """Reconstruct the built-in head from a file, with pictures and without."""
    from tomomesh import phantom

    head = phantom()
    spacing = [f"{each:.9g}" for each in head.volume.spacing_mm]
    with tempfile.TemporaryDirectory() as folder:
        np.save(f"{folder}/head.npy", head.volume.voxels)
        once = [sys.executable, "-m", "tomomesh", "reconstruct", f"{folder}/head.npy", "--spacing", *spacing]
        once += ["--lower", str(head.lower), "--upper", str(head.upper), "-o", f"{folder}/m.stl", "--quiet"]
        plain, drawn = costs(
            lambda: subprocess.run(once, check=True, capture_output=True),
            lambda: subprocess.run([*once, "--figures", f"{folder}/figures"], check=True, capture_output=True),
            repeats=RUNS,
        )
    note("whole process, 54 slices: CPU", f"{plain.cpu:.3g} s, with --figures {drawn.cpu:.3g} s")
    at_most("--figures, 13 pictures: CPU that they add", drawn.cpu - plain.cpu, 1.2, "s")


def torus() -> TriMesh:
    """Return a wavy torus of two million faces."""
    from tomomesh.model.mesh import TriMesh

    around, across = np.meshgrid(*[np.linspace(0, 2 * np.pi, SIDE, endpoint=False)] * 2, indexing="ij")
    thick = 20 + 1.5 * np.sin(9 * around) * np.cos(11 * across)
    reach = 60 + thick * np.cos(across)
    places = np.stack([reach * np.cos(around), reach * np.sin(around), thick * np.sin(across)], axis=-1)
    number = np.arange(SIDE * SIDE).reshape(SIDE, SIDE)
    right, below = np.roll(number, -1, axis=0), np.roll(number, -1, axis=1)
    beyond = np.roll(right, -1, axis=1)
    faces = [np.stack(each, axis=-1).reshape(-1, 3) for each in ((number, right, beyond), (number, beyond, below))]
    return TriMesh(np.ascontiguousarray(places.reshape(-1, 3)), np.concatenate(faces))


def ours(mesh: TriMesh) -> None:
    from tomomesh.model.mesh import TriMesh
    from tomomesh.show import save
    from tomomesh.show.space import draw_shaded

    save(draw_shaded(TriMesh(mesh.vertices, mesh.faces)), io.BytesIO())


def by_vtk(mesh: TriMesh) -> Callable[[], None]:
    """Return VTK's drawing without a window, in the process itself: Mesa's, where there is no graphics card."""
    import vtk
    from vtk.util import numpy_support

    def draw() -> None:
        points, cells, data = vtk.vtkPoints(), vtk.vtkCellArray(), vtk.vtkPolyData()
        points.SetData(numpy_support.numpy_to_vtk(mesh.vertices))
        cells.SetData(3, numpy_support.numpy_to_vtkIdTypeArray(mesh.faces.ravel()))
        data.SetPoints(points)
        data.SetPolys(cells)
        normals, mapper, actor = vtk.vtkPolyDataNormals(), vtk.vtkPolyDataMapper(), vtk.vtkActor()
        normals.SetInputData(data)
        normals.SplittingOff()
        normals.ConsistencyOff()
        mapper.SetInputConnection(normals.GetOutputPort())
        actor.SetMapper(mapper)
        renderer, window = vtk.vtkRenderer(), vtk.vtkRenderWindow()
        renderer.AddActor(actor)
        window.SetOffScreenRendering(1)
        window.SetMultiSamples(8)
        window.SetSize(900, 900)
        window.AddRenderer(renderer)
        window.Render()
        image, writer = vtk.vtkWindowToImageFilter(), vtk.vtkPNGWriter()
        image.SetInput(window)
        writer.SetInputConnection(image.GetOutputPort())
        writer.WriteToMemoryOn()
        writer.Write()

    return draw


def vtk_runs() -> bool:
    """Ask in a process of its own whether VTK draws here: without a display it may end the process."""
    code = "import vtk; w = vtk.vtkRenderWindow(); w.SetOffScreenRendering(1); w.Render()"
    code += "; assert w.GetPixelData(0, 0, 1, 1, 0) is not None"
    return subprocess.run([sys.executable, "-c", code], capture_output=True, check=False).returncode == 0


def by_matplotlib(mesh: TriMesh) -> Callable[[], None]:
    """Return a painter's drawing: faces sorted by depth and filled one after another."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.collections import PolyCollection
    from matplotlib.figure import Figure

    def draw() -> None:
        corners = mesh.vertices[mesh.faces]
        front = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        seen = np.flatnonzero(front[:, 2] > 0)
        order = seen[np.argsort(corners[seen, :, 2].mean(axis=1))]
        shade = front[order, 2] / np.linalg.norm(front[order], axis=1)
        figure = Figure(figsize=(6, 6), dpi=150)
        FigureCanvasAgg(figure)
        ax = figure.subplots()
        colors = np.repeat(shade[:, None], 3, axis=1)
        ax.add_collection(PolyCollection(list(corners[order, :, :2]), facecolors=colors, edgecolors="face"))
        ax.autoscale_view()
        figure.savefig(io.BytesIO(), format="png")

    return draw


def two_million_faces() -> None:
    mesh = torus()
    name = f"{len(mesh.faces):,} faces shaded"
    if importlib.util.find_spec("vtk") and vtk_runs():
        mine, theirs = costs(lambda: ours(mesh), by_vtk(mesh), repeats=RUNS)
        race(f"{name}, beside VTK without a window", mine, theirs, 1.0)
    else:
        note(f"{name}, beside VTK without a window", "not run: there is no VTK that draws here")
        (mine,) = costs(lambda: ours(mesh), repeats=RUNS)
    at_most(f"{name}: CPU", mine.cpu, 3.0, "s")
    if importlib.util.find_spec("matplotlib"):
        with contextlib.suppress(MemoryError):
            (theirs,) = costs(by_matplotlib(mesh), repeats=1)
            race(f"{name}, beside matplotlib's painter", mine, theirs, 0.1)


if __name__ == "__main__":
    figures()
    two_million_faces()
