"""What is said of a study, its window, and the way that it goes."""

from __future__ import annotations

from typing import Any

from ...ways import way_of


def of_stage_one(report: dict[str, Any]) -> list[str]:
    """Say what a study is, what of it was taken, and which way it goes; of points by themselves nothing."""
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


def limit_in_words(limit: float | list[float | None] | None) -> str:
    """Name a limit, or one a layer."""
    each = limit if isinstance(limit, list) else [limit]
    return ", ".join("any" if one is None else f"{one:g}" for one in each)
