"""What is said at the end of a run: fifteen lines at most."""

from __future__ import annotations

from typing import Any

from ...model.units import plain
from ...ways import way_of
from ...ways.clouds.samples import points_in_words
from ...ways.sections import unit_in_words
from .mesh import of_print, pieces_in_words
from .stage_one import of_stage_one

SHOWN = 3
"""Warnings that are told; the report has all."""


def of_surface(report: dict[str, Any], output: str) -> list[str]:
    """Say what was reconstructed, and how good it is."""
    return [
        *_of_far(report),
        *of_stage_one(report),
        f"points    {_of_points(report)}",
        *way_of(report["way"]["name"]).of_body(report),
        f"fit       {_of_fit(report)}{_of_filled(report)}",
        *_of_smooth(report),
        *_of_even(report),
        *_of_mesh(report["quality"], unit_in_words(report)),
        *_of_mask(report),
        *of_print(report),
        *_ending(report, output),
        *_of_truth(report),
    ]


def of_points(report: dict[str, Any], output: str) -> list[str]:
    """Say what was segmented."""
    return [*of_stage_one(report), f"points    {_of_points(report)}", *_ending(report, output)]


def of_network(report: dict[str, Any], output: str) -> list[str]:
    """Say how a network lies over its region."""
    network = report["network"]
    return [
        f"network   {network['topology']} of {network['neurons']} neurons on {network['inputs']} inputs",
        f"          quantization error {network['quantization_error']:.4g}, dead neurons {network['dead_neurons']}, "
        f"longest edge {network['longest_over_median_edge']:.2f} medians",
        *(f"warning   {warning}" for warning in [*network["warnings"], *report["warnings"]][:SHOWN]),
        f"written   {output}",
    ]


def _of_far(report: dict[str, Any]) -> list[str]:
    """Say first of all that a mesh is far from what it was made from."""
    far = _far(report)
    return [f"far       {far}"] if far else []


def _far(report: dict[str, Any]) -> str | None:
    told: str | None = report.get("quality", {}).get("follows", {}).get("far")
    return told


def _of_fit(report: dict[str, Any]) -> str:
    """Say whether the mesh has come to rest."""
    fit = report.get("fit", {"converged": None})
    if fit["converged"] is None:
        return "none"
    return f"{fit['iterations']} steps, {'at rest' if fit['converged'] else 'NOT at rest'}"


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


def _of_mesh(quality: dict[str, Any], unit: str) -> list[str]:
    """Say what the mesh is, and how far the points are from it."""
    shape = "closed and manifold" if quality["sound"] else "NOT closed and manifold"
    shape = shape if quality["closed"] else "a manifold sheet"
    return [
        f"mesh      {quality['vertices']} vertices, {quality['faces']} faces, {shape}, "
        f"{quality['self_intersections'] or 'no'} face(s) pass through others",
        f"          {pieces_in_words(quality)}, genus {quality['genus']}, "
        f"area {plain(quality['area_mm2'], 6)} {unit}^2{_of_volume(quality, unit)}{_of_rings(quality)}",
        *_of_distance(quality, unit),
    ]


def _of_distance(quality: dict[str, Any], unit: str) -> list[str]:
    """Say how far the points are from the mesh, which is not measured of one that is never whole."""
    if "points_to_surface_mean_mm" not in quality:
        return []
    return [
        f"distance  points to surface: mean {quality['points_to_surface_mean_mm']:.3g}, "
        f"95 % {quality['points_to_surface_p95_mm']:.3g}, largest {quality['points_to_surface_max_mm']:.3g} {unit}"
    ]


def _of_mask(report: dict[str, Any]) -> list[str]:
    """Say how well the voxels inside the mesh agree with those of the window, where they were asked for."""
    if "mask" not in report:
        return []
    mask = report["mask"]
    return [f"mask      {mask['voxels']} voxels inside the mesh, Dice {mask['dice']:.4f} with the {mask['against']}"]


def _of_truth(report: dict[str, Any]) -> list[str]:
    """Say how far the mesh is from a surface that is known exactly."""
    if "truth" not in report:
        return []
    truth = report["truth"]
    return [
        f"truth     error: mean {truth['mean_mm']:.3f} mm, 95 % {truth['p95_mm']:.3f} mm, "
        f"largest {truth['max_mm']:.2f} mm (caps aside)"
    ]


def _of_volume(quality: dict[str, Any], unit: str) -> str:
    volume = quality["volume_mm3"]
    return f", {quality['boundary_loops']} border(s)" if volume is None else f", volume {plain(volume, 6)} {unit}^3"


def _of_rings(quality: dict[str, Any]) -> str:
    ratio = quality.get("volume_over_rings")
    return "" if ratio is None else f" ({100 * ratio:.1f} % of the rings')"


def _ending(report: dict[str, Any], output: str) -> list[str]:
    warnings = [f"warning   {warning}" for warning in report["warnings"] if warning != _far(report)]
    notes = report.get("study", report["points"]).get("notes", [])
    told = [f"note      {'; '.join(notes)}"] if notes else []
    return [*told, *warnings[:SHOWN], f"written   {output}"]
