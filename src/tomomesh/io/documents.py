"""Reports as JSON and as a table, settings as TOML."""

from __future__ import annotations

import csv
import io
import json
import math
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from ..errors import FormatError
from ..settings import Settings
from .files.atomic import replacing
from .files.source import whole

if TYPE_CHECKING:
    from pathlib import Path


FORMULA = ("=", "+", "-", "@")
"""What a cell begins with that a spreadsheet may calculate."""


def write_document(data: Mapping[str, Any], path: str | Path) -> None:
    """Write a report as JSON, its entries in their own order; what is not finite becomes null.

    Parameters
    ----------
    data : mapping
        Of numbers, texts, lists, arrays and further mappings.
    path : path
        The file.

    Raises
    ------
    OutputError
        Where the file cannot be written.
    """
    with replacing(path) as file:
        file.write(json_of(data))


def json_of(data: Mapping[str, Any]) -> bytes:
    """Return a report as JSON, see `write_document`."""
    return f"{json.dumps(_plain(data), indent=2, ensure_ascii=False, allow_nan=False)}\n".encode()


def write_table(rows: Sequence[Mapping[str, Any]], columns: Sequence[str], path: str | Path) -> None:
    """Write rows as CSV with a head, in UTF-8; None and what is not finite become empty cells.

    Texts become one line each, and those that a spreadsheet would take for a formula get an apostrophe in front
    (OWASP, CSV injection).

    Raises
    ------
    OutputError
        Where the file cannot be written.
    """
    text = io.StringIO()
    table = csv.writer(text, lineterminator="\n")
    table.writerow(columns)
    table.writerows([_cell(_plain(row.get(name))) for name in columns] for row in rows)
    with replacing(path) as file:
        file.write(text.getvalue().encode("utf-8", "replace"))


def _cell(value: Any) -> Any:
    if isinstance(value, str):
        line = " ".join(value.split())
        return f"'{line}" if line.startswith(FORMULA) else line
    return str(value).lower() if isinstance(value, bool) else value


def _plain(value: Any) -> Any:
    """Turn arrays, tuples and numpy's numbers into what JSON knows."""
    if isinstance(value, Mapping):
        return {str(key): _plain(one) for key, one in value.items()}
    if isinstance(value, (np.ndarray, np.generic)):
        value = value.tolist()
    if isinstance(value, (list, tuple)):
        return [_plain(one) for one in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value


def read_settings(path: str | Path, *, base: Settings | None = None) -> Settings:
    """Read a run's parameters from a TOML file, over the defaults or over `base`.

    Raises
    ------
    UnreadableError
        Where the file is missing or may not be read.
    FormatError
        Where it is no TOML.
    UsageError
        For an entry that there is not, or a value outside its limits.
    """
    import tomllib

    try:
        sections = tomllib.loads(whole(path).decode("utf-8"))
    except UnicodeDecodeError:
        raise FormatError("the settings are no text", file=str(path), expected="TOML") from None
    except (ValueError, RecursionError) as fault:  # so does tomllib call numbers too long, and lists too deep
        raise FormatError("the settings cannot be read", file=str(path), found=str(fault), expected="TOML") from None
    return Settings.from_dict(sections, base=base, file=str(path))


def write_settings(settings: Settings, path: str | Path) -> None:
    """Write a run's parameters as TOML; those not set are left out.

    Raises
    ------
    OutputError
        Where the file cannot be written.
    """
    import tomli_w

    with replacing(path) as file:
        file.write(tomli_w.dumps(settings.to_dict()).encode("utf-8"))
