"""tomomesh: slices or points in, a closed surface mesh with its proof out."""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

__version__ = "0.1.0"

_HOMES = {
    "SOM": "som.estimator",
    "PointSet": "model.points",
    "Settings": "settings",
    "TomomeshError": "errors",
    "TriMesh": "model.mesh",
    "Volume": "model.volume",
    "assess": "measure.report",
    "compare_with_study": "agreement.study",
    "fill_mesh": "measure.fill",
    "memory_limit": "memory.limit",
    "phantom": "head_phantom",
    "read_mesh": "io",
    "read_points": "io",
    "read_volume": "io",
    "reconstruct": "pipeline",
    "reconstruct_labels": "label_surfaces",
    "reconstruct_large": "large",
    "reconstruct_points": "pipeline",
    "segment": "pipeline",
    "window": "segmentation.window",
    "write_mesh": "io",
}

__all__ = [
    "SOM",
    "PointSet",
    "Settings",
    "TomomeshError",
    "TriMesh",
    "Volume",
    "__version__",
    "assess",
    "compare_with_study",
    "fill_mesh",
    "memory_limit",
    "phantom",
    "read_mesh",
    "read_points",
    "read_volume",
    "reconstruct",
    "reconstruct_labels",
    "reconstruct_large",
    "reconstruct_points",
    "segment",
    "window",
    "write_mesh",
]

if TYPE_CHECKING:
    from .agreement.study import compare_with_study
    from .errors import TomomeshError
    from .head_phantom import phantom
    from .io import read_mesh, read_points, read_volume, write_mesh
    from .label_surfaces import reconstruct_labels
    from .large import reconstruct_large
    from .measure.fill import fill_mesh
    from .measure.report import assess
    from .memory.limit import memory_limit
    from .model.mesh import TriMesh
    from .model.points import PointSet
    from .model.volume import Volume
    from .pipeline import reconstruct, reconstruct_points, segment
    from .segmentation.window import window
    from .settings import Settings
    from .som.estimator import SOM


def __getattr__(name: str) -> Any:
    """Import a public name when it is first asked for, so that ``--help`` starts at once."""
    if name not in _HOMES:
        raise AttributeError(f"module 'tomomesh' has no attribute '{name}'")
    value = getattr(import_module(f"tomomesh.{_HOMES[name]}"), name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    """List the public names, imported or not."""
    return __all__
