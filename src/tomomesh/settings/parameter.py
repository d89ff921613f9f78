"""What a parameter is: a dataclass field that knows its unit, limits, help text and the paper's value."""

from __future__ import annotations

import math
from dataclasses import Field, dataclass, field, fields
from typing import TYPE_CHECKING, Any

from ..errors import UsageError

if TYPE_CHECKING:
    from collections.abc import Mapping

UNSET = object()
MANY = tuple(range(1, 257))
"""Lengths of a parameter that takes as many values as one likes: labels of 8 bits are no more."""
LAYERS = (1, 2, 3, 4)
"""Lengths of a parameter that takes one value, or one a layer of a color image, opacity among them."""


def param(
    default: Any,
    help: str,
    *,
    kind: type | None = None,
    unit: str = "",
    choices: tuple[str, ...] | tuple[int, ...] = (),
    low: float = -math.inf,
    above: float = -math.inf,
    high: float = math.inf,
    length: tuple[int, ...] = (),
    paper: Any = UNSET,
    metavar: tuple[str, ...] = (),
    auto: bool = False,
    repeated: bool = False,
) -> Any:
    """Declare a parameter: ``low <= value <= high`` and ``value > above``; `length` where it takes several.

    `kind` is the type of one value; it follows from the default, except where that is None or a tuple. `metavar`
    names each of several values. With `auto`, the word may be said for a number that is not set. With `repeated` it
    may be given again and again: its value is a tuple of tuples.
    """
    kind = kind or (float if default is None or isinstance(default, tuple) else type(default))
    meta = {
        "help": help,
        "kind": kind,
        "unit": unit,
        "choices": choices,
        "low": low,
        "above": above,
        "high": high,
        "length": length,
        "paper": paper,
        "metavar": metavar,
        "auto": auto,
        "repeated": repeated,
    }
    return field(default=default, metadata=meta)


@dataclass(frozen=True)
class Group:
    """Parameters that belong together: a section of the settings file and of ``--help``."""

    def __post_init__(self) -> None:
        for entry in fields(self):
            value = getattr(self, entry.name)
            plain = value.tolist() if hasattr(value, "tolist") else value
            value = _repeated(plain) if entry.metadata["repeated"] else _tupled(plain)
            value = None if entry.metadata["auto"] and value == "auto" else value
            object.__setattr__(self, entry.name, value)
            if value is not None or entry.default is not None:
                _check(entry, value)

    def paper(self) -> Mapping[str, Any]:
        """Return the values that the paper has, of parameters that stand at their defaults."""
        known = [entry for entry in fields(self) if entry.metadata["paper"] is not UNSET]
        return {entry.name: entry.metadata["paper"] for entry in known if getattr(self, entry.name) == entry.default}


def _tupled(value: Any) -> Any:
    return tuple(value) if isinstance(value, list) else value


def _repeated(value: Any) -> Any:
    """Take one list of values for a list of one."""
    if not isinstance(value, (list, tuple)):
        return value
    several = [_tupled(one) for one in value]
    return tuple(several) if any(isinstance(one, tuple) for one in several) else (tuple(several),)


def _check(entry: Field[Any], value: Any) -> None:
    for one in value if entry.metadata["repeated"] and isinstance(value, tuple) else (value,):
        _check_one(entry, one)


def _check_one(entry: Field[Any], value: Any) -> None:
    meta, option = entry.metadata, option_of(entry.name)
    if meta["choices"]:
        if value not in meta["choices"]:
            raise UsageError(
                f"{option} has no such value",
                found=f"{option} = {_said(value)}",
                expected=" | ".join(map(str, meta["choices"])),
            )
        return
    if meta["kind"] is bool:
        if not isinstance(value, bool):
            raise UsageError(f"{option} is a switch", found=f"{option} = {_said(value)}", expected="true or false")
        return
    values = value if isinstance(value, tuple) else (value,)
    if len(values) not in (meta["length"] or (1,)) or (isinstance(value, tuple) and not meta["length"]):
        counts = "at least one" if meta["length"] == MANY else " or ".join(map(str, meta["length"] or ("one",)))
        raise UsageError(
            f"{option} has too few or too many values", found=f"{option} = {_said(value)}", expected=counts
        )
    if not all(_inside(meta, one) for one in values):
        raise UsageError(
            f"{option} is outside its limits", found=f"{option} = {_said(value)}", expected=limits_of(entry)
        )


def _said(value: Any) -> str:
    return " ".join(map(str, value)) if isinstance(value, tuple) else str(value)


def _inside(meta: Mapping[str, Any], value: Any) -> bool:
    if meta["kind"] is str:
        return isinstance(value, str) and bool(value.strip())
    if isinstance(value, bool) or not isinstance(value, int if meta["kind"] is int else (int, float)):
        return False
    try:
        finite = math.isfinite(value)
    except OverflowError:  # a whole number beyond what a float can hold
        return False
    return bool(finite and meta["low"] <= value <= meta["high"] and value > meta["above"])


def limits_of(entry: Field[Any]) -> str:
    """Put a parameter's limits into words."""
    meta = entry.metadata
    words = [{int: "a whole number", str: "text"}.get(meta["kind"], "a number")]
    words += [f"over {meta['above']:g}"] if math.isfinite(meta["above"]) else []
    words += [f"at least {meta['low']:g}"] if math.isfinite(meta["low"]) else []
    words += [f"at most {meta['high']:g}"] if math.isfinite(meta["high"]) else []
    return words[0] + (" " + ", ".join(words[1:]) if words[1:] else "")


def option_of(name: str) -> str:
    """Return the command line's spelling of a parameter."""
    return "--" + name.replace("_", "-")


def asked_by(entry: Field[Any]) -> str:
    """Return the option that asks for a parameter: a switch that is on can only be turned off."""
    return option_of(f"no_{entry.name}" if entry.metadata["kind"] is bool and entry.default else entry.name)
