"""tomomesh: slices or points in, a closed surface mesh with its proof out."""

from __future__ import annotations

import sys
from importlib import import_module
from types import ModuleType
from typing import TYPE_CHECKING, Any

__version__ = "0.1.0"

_HOMES = {
    "SOM": "segment.som.estimator",
    "PointSet": "model.points",
    "Settings": "settings",
    "TomomeshError": "errors",
    "TriMesh": "model.mesh",
    "Volume": "model.volume",
    "assess": "measure.report",
    "fill_mesh": "measure.fill",
    "phantom": "phantom",
    "read_mesh": "io",
    "read_points": "io",
    "read_volume": "io",
    "reconstruct": "pipeline",
    "reconstruct_points": "pipeline",
    "segment": "pipeline",
    "window": "segment.window",
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
    "fill_mesh",
    "phantom",
    "read_mesh",
    "read_points",
    "read_volume",
    "reconstruct",
    "reconstruct_points",
    "segment",
    "window",
    "write_mesh",
]

if TYPE_CHECKING:
    from .errors import TomomeshError
    from .io import read_mesh, read_points, read_volume, write_mesh
    from .measure.fill import fill_mesh
    from .measure.report import assess
    from .model.mesh import TriMesh
    from .model.points import PointSet
    from .model.volume import Volume
    from .phantom import phantom
    from .pipeline import reconstruct, reconstruct_points, segment
    from .segment.som.estimator import SOM
    from .segment.window import window
    from .settings import Settings


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


class _Package(ModuleType):
    """Keep a public name its function's, where a module of the same name is imported too."""

    def __setattr__(self, name: str, value: Any) -> None:
        if not (name in _HOMES and isinstance(value, ModuleType)):
            super().__setattr__(name, value)


sys.modules[__name__].__class__ = _Package
