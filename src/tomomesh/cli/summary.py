"""What is said at the end: fifteen lines at most."""

from __future__ import annotations

from typing import Any

from ..measure.topology import FAULTS
from ..ways import way_of
from ..ways.samples import points_in_words
from ..ways.sections import unit_in_words
from .against import of_agreement

WIDTHS = ("thinnest_wall_mm", "thinnest_gap_mm")
"""Keys of the widths that are told of a part."""
LARGEST = 3
"""Components that are described one by one."""
SHOWN = 3
"""Warnings that are told; the report has all."""


def of_surface(report: dict[str, Any], output: str) -> list[str]:
    """Say what was reconstructed, and how good it is."""
    quality = report["quality"]
    unit = unit_in_words(report)
    shape = "closed and manifold" if quality["sound"] else "NOT closed and manifold"
    shape = shape if quality["closed"] else "a manifold sheet"
    lines = [
        *_of_far(report),
        *_of_stage_one(report),
        f"points    {_of_points(report)}",
        *way_of(report["way"]["name"]).of_body(report),
        f"fit       {_of_fit(report)}{_of_filled(report)}",
        *_of_smooth(report),
        *_of_even(report),
        f"mesh      {quality['vertices']} vertices, {quality['faces']} faces, {shape}, "
        f"{quality['self_intersections'] or 'no'} face(s) pass through others",
        f"          {pieces_in_words(quality)}, genus {quality['genus']}, "
        f"area {quality['area_mm2']:.6g} {unit}^2{_of_volume(quality, unit)}{_of_rings(quality)}",
        f"distance  points to surface: mean {quality['points_to_surface_mean_mm']:.3g}, "
        f"95 % {quality['points_to_surface_p95_mm']:.3g}, largest {quality['points_to_surface_max_mm']:.3g} {unit}",
    ]
    if "mask" in report:
        mask = report["mask"]
        lines.append(
            f"mask      {mask['voxels']} voxels inside the mesh, Dice {mask['dice']:.4f} with the {mask['against']}"
        )
    lines += _of_print(report) + _ending(report, output)
    if "truth" in report:
        truth = report["truth"]
        lines.append(
            f"truth     error: mean {truth['mean_mm']:.3f} mm, 95 % {truth['p95_mm']:.3f} mm, "
            f"largest {truth['max_mm']:.2f} mm (caps aside)"
        )
    return lines


def of_points(report: dict[str, Any], output: str) -> list[str]:
    """Say what was segmented."""
    return [*_of_stage_one(report), f"points    {_of_points(report)}", *_ending(report, output)]


def of_network(report: dict[str, Any], output: str) -> list[str]:
    """Say how a network lies over its region."""
    network = report["network"]
    return [
        f"network   {network['topology']} of {network['neurons']} neurons on {network['inputs']} inputs",
        f"          quantization error {network['quantization_error']:.4g}, dead neurons {network['dead_neurons']}, "
        f"longest edge {network['longest_over_median_edge']:.2f} medians",
        *(f"warning   {warning}" for warning in report["warnings"][:SHOWN]),
        f"written   {output}",
    ]


def of_row(place: str, row: dict[str, Any]) -> str:
    """Say in one line what became of one study of a batch."""
    if row["exit_code"]:
        return f"{place}: failed"
    if row.get("passed"):
        return f"{place}: finished before"
    shape = "sound" if row["sound"] else "NOT sound"
    return f"{place}: {row['faces']} faces, {pieces_in_words(row)}, {shape}, {row['seconds']:.1f} s"


def of_batch(rows: list[dict[str, Any]], output: str) -> str:
    """Say in one line what became of a batch."""
    failed, passed = (sum(bool(row.get(name)) for row in rows) for name in ("exit_code", "passed"))
    return f"written   {output}: {len(rows) - failed - passed} reconstructed, {passed} finished before, {failed} failed"


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
        *_of_print(report),
    ]
    return lines + of_agreement(report)


def of_part(told: dict[str, Any], output: str) -> list[str]:
    """Say what a part is, and whether it can be printed."""
    return [*_of_print({"print": told}), f"written   {output}"]


def _of_print(report: dict[str, Any]) -> list[str]:
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


def _volume(found: dict[str, Any]) -> str:
    """Name the volume of what is closed, and say so of what is not."""
    return ", open" if found["volume_mm3"] is None else f", volume {found['volume_mm3']:.6g}"


def _of_far(report: dict[str, Any]) -> list[str]:
    """Say first of all that a mesh is far from what it was made from."""
    far = _far(report)
    return [f"far       {far}"] if far else []


def _far(report: dict[str, Any]) -> str | None:
    told: str | None = report.get("quality", {}).get("follows", {}).get("far")
    return told


def _of_stage_one(report: dict[str, Any]) -> list[str]:
    if "study" not in report:
        return []
    study, window = report["study"], report["window"]
    lower, upper = limit_in_words(window["lower"]), limit_in_words(window["upper"])
    joined = f", in {window['joined_by']} of {window['layers']} layers" if window["joined_by"] else ""
    chosen = {"otsu": "Otsu's, as no window was given", "preset": "the preset", "given": "as given", "labels": ""}
    part = " of a part of the study" if study["crop"] else ""
    lines = [
        f"study     {study['slices']} {study['plane']} slices of {study['columns']} x {study['rows']}{part}",
        f"window    {lower} < k <= {upper} ({chosen[window['chosen_by']]}{joined}), "
        f"{100 * window['share']:.1f} % of the voxels",
    ]
    if window["chosen_by"] == "labels":
        select = ", ".join(map(str, report["settings"]["window"]["select"]))
        lines[-1] = f"window    label(s) {select}, {100 * window['share']:.1f} % of the voxels"
    return [*lines, *_of_kept(window), *of_way(report["way"]), *way_of(report["way"]["name"]).of_networks(report)]


def _of_kept(window: dict[str, Any]) -> list[str]:
    """Say what was left out of the window, and filled in it, in shares of its voxels."""
    whole = window["window_voxels"]
    left = {"outside the body": "dropped_voxels", "of air of the room": "room_voxels"}
    left |= {f"in {window['specks']} speck(s)": "speck_voxels"}
    filled = {f"in {window['filled_pores']} pore(s)": "filled_pore_voxels", "what it encloses": "filled_lining_voxels"}
    told = [f"{window[key] / whole:.2%} {name} left out" for name, key in left.items() if window[key]]
    told += [f"{window[key] / whole:.2%} {name} filled" for name, key in filled.items() if window[key]]
    told += [f"{window['padding_voxels']} voxels of padding made background"] if window["padding_voxels"] else []
    return [f"kept      {window['voxels']} voxels: {', '.join(told)}"] if told else []


def of_way(way: dict[str, Any]) -> list[str]:
    """Say which way was chosen for a window, why, and how to get another."""
    if not way["chosen"]:
        return []
    _, name = way["option"].split()
    others = "|".join(other for other, told in way["others"].items() if told["applies"])
    return [f"way       {name}: {way['because']} (--way {others} for another)"]


def _of_fit(report: dict[str, Any]) -> str:
    """Say whether the mesh has come to rest."""
    fit = report.get("fit", {"converged": None})
    if fit["converged"] is None:
        return "none"
    return f"{fit['iterations']} steps, {'at rest' if fit['converged'] else 'NOT at rest'}"


def pieces_in_words(quality: dict[str, Any]) -> str:
    """Count the pieces of a mesh, and the cavities in them, whose linings are components too."""
    lined = quality["cavities"] or 0
    if not lined:
        return f"{quality['components']} component(s)"
    return f"{quality['components'] - lined} piece(s) with {lined} cavity(ies)"


def limit_in_words(limit: float | list[float | None] | None) -> str:
    """Name a limit, or one a layer."""
    each = limit if isinstance(limit, list) else [limit]
    return ", ".join("any" if one is None else f"{one:g}" for one in each)


def _of_points(report: dict[str, Any]) -> str:
    points, unit = report["points"], unit_in_words(report)
    if "noise_mm" in points:
        return points_in_words(report)
    made = ""
    if points.get("on_bridges") or points.get("on_caps"):
        bridges = "bridged gaps" if "networks" in report else "voxels added where two touch"
        made = f", {points['on_bridges']} on {points['bridged_gaps']} {bridges}, "
        made += f"{points['on_caps']} where the study ends" if points["on_caps"] else "none where the study ends"
    return f"{points['count']}{made}; up to {points['spacing_mm']:.4g} {unit} apart"


def _of_smooth(report: dict[str, Any]) -> list[str]:
    """Say how far smoothing has moved the vertices."""
    if "smooth" not in report:
        return []
    told, unit = report["smooth"], unit_in_words(report)
    change = "" if told["volume_change"] is None else f", volume {100 * told['volume_change']:+.2g} %"
    return [
        f"smooth    vertices moved by {told['moved_mean_mm']:.3g} on average, 95 % at most {told['moved_p95_mm']:.3g}, "
        f"the most {told['moved_max_mm']:.3g} {unit}{change}"
    ]


def _of_even(report: dict[str, Any]) -> list[str]:
    """Say how long and how even the triangles are."""
    if not report.get("remesh", {}).get("done"):
        return []
    least = report["quality"]["p1_smallest_angle_deg"]
    kept = report["remesh"]["kept_vertices"]
    left = f", {kept} vertices left where sheets nearly touch" if kept else ""
    return [
        f"triangles edges of {report['remesh']['edge_mm']:.3g} {unit_in_words(report)}, smallest angles {least:.0f} "
        f"degrees (1 %){left}"
    ]


def _of_filled(report: dict[str, Any]) -> str:
    """Say what share of the mesh lies where a cloud has no points."""
    if report.get("fit", {}).get("converged") is None or "filled_faces" not in report["fit"]:
        return ""
    share = report["fit"]["filled_faces"] / report["quality"]["faces"]
    return f", {100 * share:.3g} % of the faces filled, not measured"


def _of_volume(quality: dict[str, Any], unit: str) -> str:
    volume = quality["volume_mm3"]
    return f", {quality['boundary_loops']} border(s)" if volume is None else f", volume {volume:.6g} {unit}^3"


def _of_rings(quality: dict[str, Any]) -> str:
    ratio = quality.get("volume_over_rings")
    return "" if ratio is None else f" ({100 * ratio:.1f} % of the rings')"


def _ending(report: dict[str, Any], output: str) -> list[str]:
    warnings = [f"warning   {warning}" for warning in report["warnings"] if warning != _far(report)]
    notes = report.get("study", report["points"]).get("notes", [])
    told = [f"note      {'; '.join(notes)}"] if notes else []
    return [*told, *warnings[:SHOWN], f"written   {output}"]
