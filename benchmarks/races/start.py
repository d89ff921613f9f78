"""From a command to a file: the whole process, the import alone, and the first demo where nothing is compiled."""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
from importlib.util import find_spec
from pathlib import Path

from bench import at_most, costs, note, race

PEER = """
import SimpleITK
from vtkmodules.util.numpy_support import numpy_to_vtk
from vtkmodules.vtkCommonDataModel import vtkImageData
from vtkmodules.vtkFiltersCore import vtkSurfaceNets3D, vtkWindowedSincPolyDataFilter
from vtkmodules.vtkIOGeometry import vtkSTLWriter

study, mesh, lower, upper = sys.argv[1:]
image = SimpleITK.ReadImage(study)
voxels = SimpleITK.GetArrayFromImage(SimpleITK.BinaryThreshold(image, float(lower), float(upper), 1, 0))
grid = vtkImageData()
grid.SetDimensions(image.GetSize())
grid.SetSpacing(image.GetSpacing())
grid.GetPointData().SetScalars(numpy_to_vtk(voxels.ravel()))
nets = vtkSurfaceNets3D()
nets.SetInputData(grid)
nets.SetValue(0, 1)
nets.SmoothingOff()
nets.SetOutputMeshTypeToTriangles()
smooth = vtkWindowedSincPolyDataFilter()
smooth.SetInputConnection(nets.GetOutputPort())
smooth.SetNumberOfIterations(20)
writer = vtkSTLWriter()
writer.SetFileTypeToBinary()
writer.SetFileName(mesh)
writer.SetInputConnection(smooth.GetOutputPort())
writer.Write()
"""
"""What else one would write: SimpleITK reads and thresholds, VTK's surface nets, windowed sinc and binary STL."""


def main() -> None:
    with tempfile.TemporaryDirectory() as folder:
        os.environ.pop("PYTHONDONTWRITEBYTECODE", None)  # an installed program has its bytecode, and so have its peers
        os.environ["PYTHONPYCACHEPREFIX"] = f"{folder}/bytecode"
        study, window = _study(Path(folder))
        line = [*_program(), "reconstruct", str(study), "-o", f"{folder}/m.stl", "--quiet"]
        for name, more in (("as it is", []), ("--network none", ["--network", "none"])):
            _command(
                f"54 slices to STL, {name}", [*line, "--lower", window[0], "--upper", window[1], *more], study, window
            )
        _import()
        _first_demo(Path(folder))


def _study(folder: Path) -> tuple[Path, tuple[str, str]]:
    """Write the built-in head; return its path and its window."""
    import nibabel
    import numpy as np

    from tomomesh import phantom

    head = phantom()
    path = folder / "head.nii.gz"
    affine = np.diag([*head.volume.spacing_mm, 1.0])
    nibabel.save(nibabel.Nifti1Image(np.rint(head.volume.voxels).astype(np.int16).T, affine), path)
    return path, (str(head.lower), str(head.upper))


def _program() -> list[str]:
    return [sys.executable, "-m", "tomomesh"]


def _command(figure: str, line: list[str], study: Path, window: tuple[str, str]) -> None:
    peer = [sys.executable, "-c", "import sys" + PEER, str(study), f"{study.parent}/peer.stl", *window]
    if not (find_spec("SimpleITK") and find_spec("vtkmodules")):
        (ours,) = costs(lambda: _run(*line))
        note(figure, "no peer: SimpleITK and vtk are not installed")
    else:
        ours, theirs = costs(lambda: _run(*line), lambda: _run(*peer))
        race(figure, ours, theirs, 0.9)
    at_most(f"{figure}: CPU", ours.cpu, 1.2, "s")


def _import() -> None:
    ours, numpy = costs(
        lambda: _run(sys.executable, "-c", "import tomomesh.pipeline"),
        lambda: _run(sys.executable, "-c", "import numpy"),
    )
    at_most("import tomomesh.pipeline: CPU", ours.cpu, 0.6, "s")
    note("of it Python and NumPy", f"{numpy.cpu:.3g} s")


def _first_demo(folder: Path) -> None:
    """Compile what a demo needs, once; it cannot be warm."""
    caches = {"XDG_CACHE_HOME": str(folder / "cache"), "XDG_CONFIG_HOME": str(folder / "config")}
    demo = [*_program(), "demo", "--quiet", "-o", str(folder / "demo")]
    (first,) = costs(lambda: _run(*demo, caches=caches), repeats=1, warm=False)
    at_most("first demo, nothing compiled: wall", first.wall, 6, "s")


def _run(*command: str, caches: dict[str, str] | None = None) -> None:
    subprocess.run(command, check=True, stdout=subprocess.DEVNULL, env={**os.environ, **(caches or {})})


if __name__ == "__main__":
    main()
