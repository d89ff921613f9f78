"""A trained network as a file of plain arrays, which nothing in it can run."""

from __future__ import annotations

import json
import zipfile
from dataclasses import asdict, fields
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from ..errors import FormatError, UnreadableError, UsageError
from ..model.graph import Lattice
from .history import History

if TYPE_CHECKING:
    from numpy.typing import NDArray

FORMAT = "tomomesh network 1"
"""First entry of the file; another number where it changes."""


def save_network(
    path: str | Path,
    params: dict[str, Any],
    figures: dict[str, float],
    arrays: dict[str, NDArray[Any]],
    lattice: Lattice,
    history: History,
) -> None:
    """Write a network.

    Parameters
    ----------
    path : str or Path
    params : dict
        Numbers, strings, tuples of them, arrays, None.
    figures : dict
        Numbers.
    arrays : dict
    lattice : Lattice
    history : History

    Raises
    ------
    UsageError
        For a parameter that no file can hold.
    """
    if functions := [name for name, value in params.items() if callable(value)]:
        raise UsageError(
            "a function cannot be saved", found=f"{functions[0]} is a callable",
            hint="set_params it to a named fall before saving, and back after loading",
        )  # fmt: skip
    large = {name: np.asarray(value) for name, value in params.items() if isinstance(value, (np.ndarray, list))}
    small = {name: value for name, value in params.items() if name not in large}
    head = {"format": FORMAT, "params": small, "figures": figures, "lattice": [lattice.name, lattice.shape]}
    graph = {name: getattr(lattice, name) for name in ("edges", "hops", "places", "faces")}
    groups = {"param": large, "array": arrays, "lattice": graph, "history": asdict(history)}
    named = {f"{group}.{name}": value for group, values in groups.items() for name, value in values.items()}
    with Path(path).open("wb") as file:  # a name without .npz stays as it is
        np.savez_compressed(file, allow_pickle=False, head=np.array(json.dumps(head, default=_plain)), **named)


def _plain(value: Any) -> Any:
    """Turn numpy's numbers into Python's."""
    if hasattr(value, "item"):
        return value.item()
    raise UsageError("a parameter cannot be saved", found=str(type(value)), expected="a number, a name or an array")


def load_network(path: str | Path) -> tuple[dict[str, Any], dict[str, Any]]:
    """Read a network.

    Returns
    -------
    params : dict
    state : dict
        The figures and arrays, ``"lattice_"`` and ``"history_"``.

    Raises
    ------
    UnreadableError, FormatError
        Where there is no such file, and where it is no saved network.
    """
    try:
        with np.load(path, allow_pickle=False) as file:
            return _parsed({name: file[name] for name in file.files})
    except OSError as error:
        raise UnreadableError("the file cannot be opened", file=str(path), found=type(error).__name__) from error
    except (ValueError, KeyError, TypeError, EOFError, AttributeError, zipfile.BadZipFile) as error:
        raise FormatError("this is no saved network", file=str(path), expected="a file that SOM.save wrote") from error


def _parsed(entries: dict[str, NDArray[Any]]) -> tuple[dict[str, Any], dict[str, Any]]:
    head = json.loads(str(entries["head"]))
    if head["format"] != FORMAT:
        raise ValueError(head["format"])
    params = {name: tuple(value) if isinstance(value, list) else value for name, value in head["params"].items()}
    params |= _group(entries, "param")
    name, shape = head["lattice"]
    lattice = Lattice(name, shape=tuple(shape), **_group(entries, "lattice"))
    past = _group(entries, "history")
    history = History(*(past[entry.name] for entry in fields(History)))
    return params, head["figures"] | _group(entries, "array") | {"lattice_": lattice, "history_": history}


def _group(entries: dict[str, NDArray[Any]], group: str) -> dict[str, NDArray[Any]]:
    return {name.removeprefix(f"{group}."): value for name, value in entries.items() if name.startswith(f"{group}.")}
