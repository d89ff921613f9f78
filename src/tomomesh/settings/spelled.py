"""Settings as the words of a command line."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from .parameter import LAYERS, MANY, asked_by, option_of

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping
    from dataclasses import Field


def spelled(entry: Field[Any], value: Any) -> list[str]:
    """Return the words that give a parameter a value: those that are read back as the very same number.

    Examples
    --------
    >>> from tomomesh.settings import parameters
    >>> known = {entry.name: entry for _, entry in parameters()}
    >>> spelled(known["lower"], 0.1), spelled(known["select"], (1, 5)), spelled(known["remesh"], False)
    (['--lower', '0.1'], ['--select=1,5'], ['--no-remesh'])
    >>> spelled(known["drop_at"], ((1, 2, 3), (4, 5, 6.5)))
    ['--drop-at', '1', '2', '3', '--drop-at', '4', '5', '6.5']
    """
    if entry.metadata["kind"] is bool:
        return [asked_by(entry)]
    if entry.metadata["repeated"]:
        return [word for one in value for word in (option_of(entry.name), *map(_number, one))]
    values = [_number(one) for one in (value if isinstance(value, (tuple, list)) else [value])]
    if entry.metadata["length"] == MANY or (entry.metadata["length"] == LAYERS and len(values) > 1):
        return [f"{option_of(entry.name)}={','.join(values)}"]
    return [option_of(entry.name), *values]


def differing(entries: Mapping[str, Field[Any]], values: Mapping[str, Any]) -> Iterator[tuple[Field[Any], Any]]:
    """Yield the parameters whose values are not their defaults."""
    for name, entry in entries.items():
        if values.get(name) is not None and values[name] != entry.default:
            yield entry, values[name]


def _number(value: Any) -> str:
    short = f"{value:g}" if isinstance(value, float) else str(value)
    return short if not isinstance(value, float) or float(short) == value else repr(value)
