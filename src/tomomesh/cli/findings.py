"""What `tomomesh inspect` tells a person."""

from __future__ import annotations

from typing import Any

from .summary import limit_in_words

BARS = " ▁▂▃▄▅▆▇█"
LISTED = 12
"""Labels that are listed, the largest first."""
TILTED = 0.1
"""Degrees from which on a tilt is mentioned."""


def of_study(found: dict[str, Any], study: str) -> list[str]:
    """Say what is in a study, and what to do with it."""
    slices, rows, columns = found["slices_rows_columns"]
    x, y, z = found["spacing_mm"]
    tilt = f"; slices sheared by {found['tilt_deg']:.1f} deg" if found["tilt_deg"] >= TILTED else ""
    return [
        f"size      {slices} slices x {rows} rows x {columns} columns (S x P x L), "
        f"{found['layers']} layer(s) of {found['type']}",
        f"spacing   {x:g} x {y:g} x {z:g} mm (L, P, S){tilt}",
        f"extent    {' x '.join(f'{side:.1f}' for side in found['size_mm'])} mm, first voxel at "
        f"({', '.join(f'{c:.1f}' for c in found['corner_mm'])}) mm LPS",
        f"slices    stored {found['stored_plane']}, columns-rows-slices run {found['stored_axes']}; "
        f"taken {found['default_plane']} by default",
        f"levels    {found['lowest']:g} to {found['highest']:g} ({found['gray_unit']})",
        f"          {_histogram(found['histogram'])}",
        _windows(found["windows"]),
        *([_labels(found["labels"])] if found["labels"] else []),
        *(f"note      {note}" for note in found["notes"]),
        f"next      tomomesh reconstruct {_options(found, study)} -o mesh.stl",
    ]


def _histogram(counts: list[int]) -> str:
    tallest = max(max(counts), 1)
    return "".join(BARS[round((len(BARS) - 1) * (count / tallest) ** 0.5)] for count in counts)


def _windows(windows: dict[str, Any]) -> str:
    told = [f"{name}: k > {limit_in_words(one['lower'])} ({one['share']:.1%})" for name, one in windows.items()]
    return f"windows   {'; '.join(told)}"


def _labels(labels: dict[str, int]) -> str:
    largest = sorted(labels.items(), key=lambda entry: (-entry[1], int(entry[0])))
    told = ", ".join(f"{label} ({count})" for label, count in largest[:LISTED])
    more = f" and {len(labels) - LISTED} more" if len(labels) > LISTED else ""
    return f"labels    {len(labels)}, with their voxels: {told}{more}"


def _options(found: dict[str, Any], study: str) -> str:
    """Name the options of a first try: the largest label, bone, or Otsu's window."""
    labels = found["labels"]
    if labels:
        return f"--labels-in {study} --select {max(labels, key=lambda label: labels[label])}"
    bone = found["windows"].get("bone", {"share": 0})
    return f"{study} --preset bone" if bone["share"] else study
