"""What is said of a mesh by itself: whether it is sound, can be printed, and is what it should be."""

from __future__ import annotations

from typing import Any

from ...measure.topology import FAULTS

WIDTHS = ("thinnest_wall_mm", "thinnest_gap_mm")
"""Keys of the widths that are told of a part."""
LARGEST = 3
"""Components that are described one by one."""


def of_check(report: dict[str, Any]) -> list[str]:
    """Say what a mesh is."""
    faults = [f"{report[name]} {name.replace('_', ' ')}" for name in FAULTS if report[name]]
    shape = "closed, manifold, outward" if report["sound"] else f"NOT sound: {', '.join(faults)}"
    same = "the same" if report["sound_after_welding"] == report["sound"] else "NOT the same"
    loops = f", {report['boundary_loops']} border(s)" if report["boundary_loops"] else ""
    lines = [
        f"mesh      {report['vertices']} vertices, {report['faces']} faces",
        f"topology  {shape}; {same} after welding at 32 bits",
        f"          {pieces_in_words(report)}, Euler number {report['euler_number']}"
        + (f", genus {report['genus']}" if report["sound"] else "")
        + loops,
        f"crossing  {report['self_intersections'] or 'no'} face(s) pass through others",
        f"size      area {report['area_mm2']:.6g}{_volume(report)}",
        f"edges     {report['shortest_edge_mm']:.4g} to {report['longest_edge_mm']:.4g}, "
        f"median {report['median_edge_mm']:.4g}; the surface turns by {report['mean_turn_deg']:.1f} deg on average",
        f"angles    {report['smallest_angle_deg']:.1f} to {report['largest_angle_deg']:.1f} deg, "
        f"mean of the smallest {report['mean_smallest_angle_deg']:.1f} deg",
        *_parts(report),
        *of_print(report),
    ]
    return lines + _of_agreement(report)


def of_part(told: dict[str, Any], output: str) -> list[str]:
    """Say what a part is, and whether it can be printed."""
    return [*of_print({"print": told}), f"written   {output}"]


def of_print(report: dict[str, Any]) -> list[str]:
    """Say whether a mesh can be printed, and why not, where that was asked for."""
    told = report.get("print")
    if told is None:
        return []
    size = " x ".join(f"{side:.4g}" for side in told["size_mm"])
    widths = [f"{told[key]:.3g} mm" if told.get(key) is not None else "none found" for key in WIDTHS]
    verdict = "yes" if told["printable"] else f"no: {'; '.join(told['reasons'])}"
    return [
        f"part      {size} mm, {told['volume_mm3'] / 1000:.4g} cm^3 of material, "
        f"{100 * told['overhang_share']:.3g} % of the surface hangs over",
        f"          thinnest wall {widths[0]}, narrowest gap {widths[1]}",
        f"printable {verdict}",
        *(f"note      {note}" for note in told["notes"]),
    ]


def _parts(report: dict[str, Any]) -> list[str]:
    """Say what the largest components are, where there are several."""
    parts = report["per_component"]
    if len(parts) < 2:
        return []
    lines = [
        f"part {n}    {part['faces']} faces, {part['self_intersections'] or 'no'} crossing, "
        f"area {part['area_mm2']:.4g}{_volume(part)}, genus {part['genus']}"
        for n, part in enumerate(parts[:LARGEST], 1)
    ]
    more = report["components"] - len(lines)
    return [*lines, f"          and {more} more"] if more else lines


def _of_agreement(report: dict[str, Any]) -> list[str]:
    """Say in a table how near a mesh is to what it should equal."""
    if "against" not in report:
        return []
    what = {"mesh": "the other", "labels": "the labels", "window": "the window"}[report["against"]["against"]]
    dice = "none, as what is open has no inside" if report["dice"] is None else f"{report['dice']:.4f}"
    rows = {f"to {what}": "", f"from {what}": "back_"}
    return [
        f"against   {what}: Dice {dice}",
        f"          {'distance':24}{'mean':>10}{'95 %':>10}{'largest':>10}",
        *(
            f"          {row:24}" + "".join(f"{report[f'{way}{key}_mm']:10.4g}" for key in ("mean", "p95", "max"))
            for row, way in rows.items()
        ),
        *(f"note      {note}" for note in report["against"]["notes"]),
    ]


def _volume(found: dict[str, Any]) -> str:
    """Name the volume of what is closed, and say so of what is not."""
    return ", open" if found["volume_mm3"] is None else f", volume {found['volume_mm3']:.6g}"


def pieces_in_words(quality: dict[str, Any]) -> str:
    """Count the pieces of a mesh, and the cavities in them, whose linings are components too."""
    lined = quality["cavities"] or 0
    if not lined:
        return f"{quality['components']} component(s)"
    return f"{quality['components'] - lined} piece(s) with {lined} cavity(ies)"
