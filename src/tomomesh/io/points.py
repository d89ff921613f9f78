"""Clouds of points: in and out."""

from __future__ import annotations

import io
from typing import TYPE_CHECKING, Any

import numpy as np

from ..errors import EmptyError, FormatError
from ..model.points import PointSet
from .atomic import check_output, replacing
from .ply import Element, parse_header, write_ply
from .signature import signature
from .source import existing_file, suffix_of, third_party, whole
from .text import delimiter_of, parse_rows

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

    from numpy.typing import NDArray


def read_points(path: str | Path) -> PointSet:
    """Read a cloud.

    Parameters
    ----------
    path : path
        ``.ply`` (text or binary), ``.xyz``, ``.txt`` or ``.csv`` (the first three columns; one line of names
        may come first), or ``.npy`` with an (n, 3) array.

    Returns
    -------
    PointSet
        Positions as the file has them, in its own unit.

    Raises
    ------
    UnreadableError
        Where the file is missing or may not be read.
    FormatError
        For text, NaN, ragged rows (it names the row), a count that lies, and unknown suffixes.
    EmptyError
        For a file without points.
    """
    path = existing_file(path)
    reader = POINT_READERS.get(suffix_of(path))
    if reader is None:
        raise FormatError(
            "the file is of an unknown kind",
            file=str(path),
            found=f"suffix = {suffix_of(path) or 'none'}",
            expected=" | ".join(POINT_READERS),
        )
    positions = reader(path)
    if len(positions) == 0:
        raise EmptyError("the cloud has no points", file=str(path))
    check_finite(positions, "row", file=str(path))
    return PointSet.from_positions(positions)


def check_finite(positions: NDArray[np.float64], row: str, *, file: str) -> None:
    """Refuse NaN and infinite coordinates.

    Raises
    ------
    FormatError
        It names the first row, from 1.
    """
    broken = ~np.isfinite(positions).all(axis=1)
    if broken.any():
        raise FormatError(
            "a coordinate is not finite",
            file=file,
            found=f"{row} {int(broken.argmax()) + 1}, {int(broken.sum())} in all",
            expected="finite numbers",
        )


def _read_text(path: Path) -> NDArray[np.float64]:
    try:
        lines = whole(path).decode("utf-8-sig").splitlines()
    except UnicodeDecodeError:
        raise FormatError("the file is no text", file=str(path), expected="rows of numbers") from None
    names = 1 if lines and _are_names(lines[0]) else 0
    return parse_rows(lines[names:], columns=(0, 1, 2), file=str(path), before=names)


def _are_names(line: str) -> bool:
    """Tell whether a line names columns: three words at least, none of the first three a number."""
    fields = line.split(delimiter_of([line]))[:3]
    return len(fields) == 3 and not any(map(_is_number, fields))


def _is_number(field: str) -> bool:
    try:
        float(field)
    except ValueError:
        return False
    return True


def _read_npy(path: Path) -> NDArray[np.float64]:
    with third_party("numpy", str(path)):
        array = np.load(path, mmap_mode="r", allow_pickle=False)  # the map refuses a count that lies
    if array.ndim != 2 or array.shape[1] != 3 or array.dtype.kind not in "iuf":
        raise FormatError(
            "the array is no cloud",
            file=str(path),
            found=f"shape = {array.shape}, type = {array.dtype}",
            expected="(n, 3) real numbers",
        )
    return np.array(array, np.float64)


def _read_ply(path: Path) -> NDArray[np.float64]:
    data, file = whole(path), str(path)
    header = parse_header(data, file=file)
    vertex = header.element("vertex")
    names = [words[-1] for words in vertex.properties]
    if vertex.count and not {"x", "y", "z"} <= set(names):
        raise FormatError("the vertices have no positions", file=file, expected="properties x, y and z")
    if vertex.count == 0:
        return np.empty((0, 3))
    if header.format == "ascii":
        columns = [names.index(axis) for axis in "xyz"]
        before = sum(one.count for one in header.elements[: header.elements.index(vertex)])
        return _text_vertices(data, header.length, vertex, columns, before, file)
    import trimesh

    with third_party("trimesh", file):
        loaded: Any = trimesh.load(io.BytesIO(data), file_type="ply", process=False, maintain_order=True)
        return np.array(loaded.vertices, np.float64)


def _text_vertices(
    data: bytes, length: int, vertex: Element, columns: list[int], before: int, file: str
) -> NDArray[np.float64]:
    lines = data[length:].decode("ascii", "replace").splitlines()[before : before + vertex.count]
    head = data[:length].count(b"\n")
    positions = parse_rows(lines, columns=columns, file=file, before=head + before)
    if len(positions) < vertex.count:
        raise FormatError(
            "the file is cut off", file=file, found=f"vertices = {len(positions)}", expected=f"{vertex.count}"
        )
    return positions


POINT_READERS: dict[str, Callable[[Path], NDArray[np.float64]]] = {
    ".ply": _read_ply,
    ".xyz": _read_text,
    ".txt": _read_text,
    ".csv": _read_text,
    ".npy": _read_npy,
}
"""Suffix to reader."""


def write_points(points: PointSet, path: str | Path, *, unit: str = "mm", frame: str = "LPS") -> None:
    """Write a cloud.

    Parameters
    ----------
    points : PointSet
        Its coordinates are written as they are.
    path : path
        ``.ply`` keeps slice, neuron and kind of each point, and so does ``.csv``; ``.xyz`` and ``.npy`` keep
        positions.
    unit, frame : str
        What the coordinates are in: named in the file where its format can.

    Raises
    ------
    UsageError
        For a suffix that has no writer.
    OutputError
        Where the file cannot be written.
    """
    check_output(path, POINT_WRITERS)
    POINT_WRITERS[suffix_of(path)](points, path, unit, frame)


def _write_ply(points: PointSet, path: str | Path, unit: str, frame: str) -> None:
    fields = [("x", "f8"), ("y", "f8"), ("z", "f8"), ("slice", "i4"), ("neuron", "i4"), ("kind", "u1")]
    rows = np.empty(len(points), fields)
    rows["x"], rows["y"], rows["z"] = points.positions.T
    rows["slice"], rows["neuron"], rows["kind"] = points.slices, points.neurons, points.kinds
    write_ply(path, signature(unit, frame), rows)


def _write_xyz(points: PointSet, path: str | Path, unit: str, frame: str) -> None:
    rows = (f"{x!r} {y!r} {z!r}" for x, y, z in points.positions.tolist())
    _write_lines(path, [f"# {signature(unit, frame)}", *rows])


def _write_csv(points: PointSet, path: str | Path, unit: str, frame: str) -> None:
    head = [axis if unit == "unknown" else f"{axis}_{unit}" for axis in "xyz"]
    ids = zip(points.slices.tolist(), points.neurons.tolist(), points.kinds.tolist(), strict=True)
    rows = (
        f"{x!r},{y!r},{z!r},{slice_},{neuron},{kind}"
        for (x, y, z), (slice_, neuron, kind) in zip(points.positions.tolist(), ids, strict=True)
    )
    _write_lines(path, [",".join([*head, "slice", "neuron", "kind"]), *rows])


def _write_lines(path: str | Path, lines: list[str]) -> None:
    with replacing(path) as file:
        file.write(("\n".join(lines) + "\n").encode("ascii"))


def _write_npy(points: PointSet, path: str | Path, unit: str, frame: str) -> None:
    with replacing(path) as file:
        np.lib.format.write_array(file, np.ascontiguousarray(points.positions, "<f8"), version=(1, 0))


POINT_WRITERS: dict[str, Callable[[PointSet, str | Path, str, str], None]] = {
    ".ply": _write_ply,
    ".xyz": _write_xyz,
    ".csv": _write_csv,
    ".npy": _write_npy,
}
"""Suffix to writer."""
