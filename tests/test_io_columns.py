"""Columns of positions by what they are called: also behind others, with units, in a patient's frame, from napari."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pytest

from tomomesh.io import read_points

if TYPE_CHECKING:
    from pathlib import Path

PLACES = np.random.default_rng(2).normal(0, 30, (40, 3)).round(3)
CONTOUR = np.repeat(np.arange(4), 10)


def written(folder: Path, head: str, *columns: object, separator: str = ",", suffix: str = ".csv") -> Path:
    """Write columns under a line of names, or without one."""
    rows = np.column_stack([np.asarray(column) for column in columns]).tolist()
    lines = [separator.join(f"{value:.10g}" for value in row) for row in rows]
    path = folder / f"t{suffix}"
    path.write_text("\n".join([head, *lines] if head else lines) + "\n", "utf-8")
    return path


@pytest.mark.parametrize(
    ("head", "separator", "suffix", "unit"),
    [
        ("contour,px,py,pz", ",", ".csv", None),
        ("contour nr\tX [cm]\tY [cm]\tZ [cm]", "\t", ".txt", "cm"),
        ("slice\tx\ty\tz", "\t", ".tsv", None),
        ("slice;x;y;z", ";", ".csv", None),
        ("\ufeffcontour;X [mm];Y [mm];Z [mm]", " ; ", ".csv", "mm"),
    ],
)
def test_columns_behind_others(tmp_path: Path, head: str, separator: str, suffix: str, unit: str | None) -> None:
    path = written(tmp_path, head, CONTOUR, PLACES, separator=separator, suffix=suffix)
    found = read_points(path)
    np.testing.assert_array_equal(found.positions, PLACES)
    assert (found.unit, found.frame, found.notes) == (unit, "unknown", ())


@pytest.mark.parametrize(("axes", "frame"), [("ras", "RAS"), ("lps", "LPS"), ("LPS", "LPS"), ("xyz", "unknown")])
def test_a_patients_axes_name_its_frame(tmp_path: Path, axes: str, frame: str) -> None:
    found = read_points(written(tmp_path, ",".join(("id", *axes)), CONTOUR, PLACES))
    np.testing.assert_array_equal(found.positions, PLACES)
    assert found.frame == frame


@pytest.mark.parametrize("index", [True, False])
def test_napari_counts_its_axes_from_the_slowest(tmp_path: Path, index: bool) -> None:
    head, own = ("index,axis-0,axis-1,axis-2", [np.arange(40)]) if index else ("axis-0,axis-1,axis-2", [])
    found = read_points(written(tmp_path, head, *own, PLACES[:, ::-1]))
    np.testing.assert_array_equal(found.positions, PLACES)


@pytest.mark.parametrize(
    ("columns", "told"),
    [
        ((CONTOUR, PLACES), True),
        ((CONTOUR + 7, PLACES, CONTOUR), True),
        ((PLACES, CONTOUR), False),
        ((CONTOUR, PLACES[:, :2]), False),
        ((CONTOUR[::-1], PLACES), False),
    ],
)
def test_a_first_column_that_counts_is_told(tmp_path: Path, columns: tuple[object, ...], told: bool) -> None:
    found = read_points(written(tmp_path, "", *columns))
    np.testing.assert_array_equal(found.positions, np.column_stack([np.asarray(one) for one in columns])[:, :3])
    assert any("counts" in note for note in found.notes) == told
