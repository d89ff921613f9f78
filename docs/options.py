"""Write the tables of options in docs/command-line.md anew, from the settings: ``python docs/options.py``."""

from __future__ import annotations

import re
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from tomomesh.cli.options.parameters import spellings
from tomomesh.settings import LAYERS, MANY, UNSET, asked_by, limits_of, parameters

if TYPE_CHECKING:
    from dataclasses import Field

PAGE = Path(__file__).parent / "command-line.md"
HEAD = ["| option | what | unit | allowed | default | `--paper` |", "|---|---|---|---|---|---|"]
COUNTS = {
    (): "",
    (1, 3): "one or three: ",
    (2,): "two: ",
    (3,): "three: ",
    (6,): "six: ",
    MANY: "any number, with commas between: ",
    LAYERS: "one, or one a layer with commas between: ",
}


def write() -> None:
    """Fill each pair of marks, ``<!-- group -->`` and ``<!-- end group -->``."""
    text = PAGE.read_text(encoding="utf-8")
    for group in dict(parameters()):
        table = "\n".join([*HEAD, *(row(entry) for name, entry in parameters() if name == group)])
        marked = re.compile(rf"(<!-- {group} -->\n).*?(<!-- end {group} -->)", re.DOTALL)
        text = marked.sub(partial(_between, table), text)
    PAGE.write_text(text, encoding="utf-8")


def _between(table: str, found: re.Match[str]) -> str:
    return f"{found[1]}{table}\n{found[2]}"


def row(entry: Field[Any]) -> str:
    """Put a parameter into a row."""
    meta = entry.metadata
    switch = meta["kind"] is bool
    spelled = [asked_by(entry)] if switch else spellings(entry.name)
    what = f"do not {meta['help']}" if switch and entry.default else meta["help"]
    allowed = ", ".join(map(str, meta["choices"])) or f"{COUNTS[meta['length']]}{limits_of(entry)}"
    default, paper = _value(entry.default), _value(meta["paper"])
    if switch:
        allowed, default, paper = "switch", "off", "" if meta["paper"] is UNSET else "given"
    options = ", ".join(f"`{option}`" for option in spelled)
    return f"| {options} | {what} | {meta['unit']} | {allowed} | {default} | {paper} |"


def _value(value: Any) -> str:
    if value is None or value is UNSET:
        return ""
    if isinstance(value, tuple):
        return " ".join(map(_value, value))
    return f"{value:g}" if isinstance(value, float) else str(value)


if __name__ == "__main__":
    write()
