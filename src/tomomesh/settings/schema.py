"""The table of parameters as a JSON Schema: types, defaults, limits, choices, help and unit."""

from __future__ import annotations

import math
from dataclasses import Field, fields
from typing import TYPE_CHECKING, Any

from .parameter import UNSET

if TYPE_CHECKING:
    from collections.abc import Mapping

    from .parameter import Group

TYPES = {bool: "boolean", int: "integer", float: "number", str: "string"}
"""Types of a parameter to JSON's; a text may not be blank."""

LIMITS = {"low": "minimum", "above": "exclusiveMinimum", "high": "maximum"}
"""Limits of a parameter to JSON Schema's."""


def object_of(properties: Mapping[str, Any], **more: Any) -> dict[str, Any]:
    """Return the schema of an object that has these properties or fewer, and no others."""
    return {**more, "type": "object", "properties": dict(properties), "additionalProperties": False}


def schema_of(group: Group) -> dict[str, Any]:
    """Return the schema of a section of parameters, whose values are the defaults."""
    return object_of({entry.name: _parameter(entry) for entry in fields(group)}, description=type(group).__doc__)


def _parameter(entry: Field[Any]) -> dict[str, Any]:
    """Return the schema of a parameter; null is the value of one that is not set."""
    meta, default = entry.metadata, entry.default
    notes = {"description": meta["help"], "default": list(default) if isinstance(default, tuple) else default}
    notes |= {"unit": meta["unit"]} if meta["unit"] else {}
    notes |= {"paper": meta["paper"]} if meta["paper"] is not UNSET else {}
    allowed = [_value(meta)] if 1 in (meta["length"] or (1,)) else []
    allowed += [_array(meta)] if meta["length"] else []
    allowed += [{"enum": ["auto"]}] if meta["auto"] else []
    allowed += [{"type": "null"}] if default is None else []
    return notes | (allowed[0] if len(allowed) == 1 else {"anyOf": allowed})


def _value(meta: Mapping[str, Any]) -> dict[str, Any]:
    if meta["choices"]:
        return {"enum": list(meta["choices"])}
    limits = {word: meta[name] for name, word in LIMITS.items() if math.isfinite(meta[name])}
    return {"type": TYPES[meta["kind"]], **limits, **({"pattern": r"\S"} if meta["kind"] is str else {})}


def _array(meta: Mapping[str, Any]) -> dict[str, Any]:
    if meta["repeated"]:
        one = _array({**meta, "repeated": False})
        return {"anyOf": [one, {"type": "array", "items": one, "minItems": 1}]}
    lengths = meta["length"]
    between = [{"minItems": n, "maxItems": n} for n in range(lengths[0], lengths[-1]) if n not in lengths]
    refused = {"not": {"anyOf": between}} if between else {}
    return {"type": "array", "items": _value(meta), "minItems": lengths[0], "maxItems": lengths[-1], **refused}
