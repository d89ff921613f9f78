"""How long does a whole study of 54 slices take, against a surface extractor on the same mask."""

from __future__ import annotations

import time
from typing import TYPE_CHECKING

import numpy as np

from bench import at_most, header, median_times, note
from tomomesh import phantom, reconstruct, window

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

    from tomomesh import Volume
    from tomomesh.results import Surface


def main() -> None:
    header("reconstruct() on 54 slices of 256 x 256, report included", "vtk")
    head = phantom()
    mask = window(head.volume, lower=head.lower, upper=head.upper)
    last: list[Surface] = []

    def ours() -> None:
        last[:] = [reconstruct(head.volume, lower=head.lower, upper=head.upper)]

    nets = _surface_nets(mask, head.volume)
    seconds, peer = median_times(ours, nets, repeats=15)
    cpu, peer_cpu = median_times(ours, nets, repeats=15, clock=time.process_time)
    note("reconstruct", f"{1e3 * seconds:.0f} ms")
    note("VTK surface nets with smoothing", f"{1e3 * peer:.0f} ms")
    at_most("reconstruct over surface nets", seconds / peer, 3, "x")
    note("the same in CPU time", f"{cpu / peer_cpu:.3g} x")
    timings = last[0].report["timings"]
    for stage in (name for name in timings if name != "total_s"):
        note(f"of it {stage.removesuffix('_s')}", f"{100 * timings[stage] / timings['total_s']:.0f} %")


def _surface_nets(mask: NDArray[np.bool_], volume: Volume) -> Callable[[], None]:
    """Return VTK's surface nets over the mask, its data already in memory."""
    from vtkmodules.util.numpy_support import numpy_to_vtk
    from vtkmodules.vtkCommonDataModel import vtkImageData
    from vtkmodules.vtkFiltersCore import vtkSurfaceNets3D

    image = vtkImageData()
    image.SetDimensions(*mask.shape[::-1])
    image.SetSpacing(*volume.spacing_mm)
    image.GetPointData().SetScalars(numpy_to_vtk(mask.ravel().astype(np.uint8), deep=True))
    nets = vtkSurfaceNets3D()
    nets.SetInputData(image)
    nets.SetValue(0, 1)
    nets.SmoothingOn()
    nets.SetOutputMeshTypeToTriangles()

    def run() -> None:
        nets.Modified()
        nets.Update()

    return run


if __name__ == "__main__":
    main()
