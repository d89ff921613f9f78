"""What is known of a study that a batch is done with, and whether it still holds."""

from __future__ import annotations

import hashlib
import json
from importlib.metadata import version
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from collections.abc import Mapping
    from pathlib import Path

    from ..errors import TomomeshError
    from ..settings import Settings

    Row = dict[str, Any]

COLUMNS = (
    "name", "exit_code", "error", "seconds", "vertices", "faces", "components", "cavities", "genus", "sound",
    "self_intersections", "area_mm2", "volume_mm3", "points_to_surface_mean_mm", "points_to_surface_p95_mm",
    "points_to_surface_max_mm", "warnings",
)  # fmt: skip
"""Columns of the table of all studies; from `vertices` to the distances they are those of the report's quality."""


def record_of(mesh: Path, state: str, seconds: float) -> dict[str, Any]:
    """Return what a later run is to know: the input's state, the bytes of the mesh, and how long it took."""
    return {"input": state, "mesh_sha256": _digest(mesh), "seconds": round(seconds, 3)}


def finished(report: Path, mesh: Path, settings: Settings, state: str) -> dict[str, Any] | None:
    """Return the report of a study that is done: both files whole, from the same input, settings and version."""
    try:
        found = json.loads(report.read_bytes())
        record = found["batch"]
        same = record["input"] == state and _asked(found["settings"]) == _asked(settings.to_dict())
        same = same and found["versions"]["tomomesh"] == version("tomomesh")
        return found if same and record["mesh_sha256"] == _digest(mesh) else None
    except (OSError, ValueError, LookupError, TypeError, AttributeError):
        return None


def _asked(settings: Mapping[str, Any]) -> Any:
    """Return settings as a file holds them, without the threads, on which no result depends."""
    plain = json.loads(json.dumps(settings))
    plain["run"].pop("threads")
    return plain


def _digest(path: Path) -> str:
    with path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


def row_of_fault(name: str, error: TomomeshError) -> Row:
    """Return the row of a study that has no mesh; only words are kept of a fault, not what it holds on to."""
    return {"name": name, "exit_code": error.exit_code, "error": str(error)}


def row_of(name: str, report: Mapping[str, Any]) -> Row:
    """Return the row of a study that was reconstructed."""
    return {
        **{column: report["quality"].get(column) for column in COLUMNS},
        "name": name,
        "exit_code": 0,
        "error": "",
        "seconds": report["batch"]["seconds"],
        "warnings": len(report["warnings"]),
    }
