"""An option for each parameter: its spellings, its numbers, and its line in the help."""

from __future__ import annotations

import argparse
from decimal import Decimal
from typing import TYPE_CHECKING, Any

from ...settings import LAYERS, MANY, asked_by, limits_of, option_of, parameters

if TYPE_CHECKING:
    from collections.abc import Sequence
    from dataclasses import Field

ALIASES = {"cell_mm": "--cell"}
"""Second spellings: the numbers of a cloud need not be millimeters."""

WIDE = 40
"""Letters of choices over which they are listed in the help of an option: with its own name they would be wider than
half of a terminal of 80 columns."""


def spellings(name: str) -> list[str]:
    """Return the options by which a parameter goes."""
    return [option_of(name), *([ALIASES[name]] if name in ALIASES else [])]


SEVERAL = tuple(
    option for _, entry in parameters() if entry.metadata["length"] == (1, 3) for option in spellings(entry.name)
)
"""Options that take one number or three."""
FIXED = {
    option_of(entry.name): entry.metadata["length"][0]
    for _, entry in parameters()
    if len(entry.metadata["length"]) == 1
}
"""Options that take several numbers, and how many."""
LISTED = tuple(option_of(entry.name) for _, entry in parameters() if entry.metadata["length"] == LAYERS)
"""Options that take one number, or several with commas between."""


def joined(arguments: Sequence[str]) -> list[str]:
    """Take the numbers after an option with spaces or with commas between them.

    Those of an option that takes one number or several become one word, so that a file may follow them; those of an
    option that takes a fixed count become as many.
    """
    words: list[str] = []
    for word in arguments:
        option, _, values = words[-1].partition("=") if words else ("", "", "")
        word = _plain(word)
        own, _, listed = word.partition("=")
        if option in SEVERAL and values.count(",") < 2 and _is_number(word):
            words[-1] = f"{option}={values},{word}" if values else f"{option}={word}"
        elif option in LISTED and not values and _are_numbers(word):
            words[-1] = f"{option}={word}"  # a list that begins with a minus would look like an option
        elif own in FIXED and _are_numbers(listed):
            words += [own, *_listed(listed)]
        elif "," in word and _are_numbers(word) and _takes_more(words):
            words += _listed(word)
        else:
            words.append(word)
    return words


def _plain(word: str) -> str:
    """Write a number below 0 without an exponent, with which argparse takes it for an option."""
    is_one = word.startswith("-") and "e" in word.lower() and _is_number(word)
    return f"{Decimal(word):f}" if is_one else word


def _takes_more(words: Sequence[str]) -> bool:
    """Tell whether the last option takes more numbers than it has."""
    numbers = 0
    while numbers < len(words) and _is_number(words[-1 - numbers]):
        numbers += 1
    return numbers < len(words) and numbers < FIXED.get(words[-1 - numbers], 0)


def _listed(word: str) -> list[str]:
    return [part for part in word.split(",") if part.strip()]


def _are_numbers(word: str) -> bool:
    return bool(_listed(word)) and all(map(_is_number, _listed(word)))


def _is_number(word: str) -> bool:
    try:
        float(word)
    except ValueError:
        return False
    return True


def add_parameter(group: argparse._ArgumentGroup, entry: Field[Any]) -> None:
    """Add the option of a parameter to a group of options."""
    meta, options, name = entry.metadata, spellings(entry.name), entry.name
    if meta["kind"] is bool:
        action = "store_false" if entry.default else "store_true"
        text = (f"do not {meta['help']}" if entry.default else meta["help"]).replace("%", "%%")
        group.add_argument(asked_by(entry), dest=name, action=action, default=argparse.SUPPRESS, help=text)
        return
    one_or_three, many = options[0] in SEVERAL, meta["length"] == MANY
    listed = meta["length"] == LAYERS
    several = meta["length"][0] if meta["length"] and not (one_or_three or many or listed) else None
    group.add_argument(
        *options,
        dest=name,
        type=_numbers if one_or_three or listed else _labels if many else _kind(meta),
        nargs=several,
        action="append" if meta["repeated"] else "store",
        default=argparse.SUPPRESS,
        **(chosen_from(meta["choices"], _help(entry)) if meta["choices"] else _free(entry)),
    )


def chosen_from(choices: Sequence[Any], text: str) -> dict[str, Any]:
    """Return the arguments of an option with a choice: many are listed in its help, which is wrapped.

    Examples
    --------
    >>> chosen_from(("lps", "ras"), "the frame")
    {'choices': ('lps', 'ras'), 'metavar': None, 'help': 'the frame'}
    """
    if sum(map(len, map(str, choices))) <= WIDE:
        return {"choices": choices, "metavar": None, "help": text}
    return {"choices": choices, "metavar": "NAME", "help": f"{text}: {', '.join(map(str, choices))}"}


def _free(entry: Field[Any]) -> dict[str, Any]:
    return {"metavar": _metavar(entry.name, entry.metadata), "help": _help(entry)}


def _kind(meta: Any) -> Any:
    """Return what takes the text of one value; a word that a number may have in its place is left to the settings."""
    if not meta["auto"]:
        return meta["kind"]

    def number(text: str) -> Any:
        return text if text == "auto" else meta["kind"](text)

    number.__name__ = meta["kind"].__name__
    return number


def _metavar(name: str, meta: Any) -> Any:
    if meta["length"] in (MANY, LAYERS):
        return "N|NAME[,...]" if meta["length"] == MANY else "X[,X...]"
    if meta["length"] in ((), (1, 3)):
        return "X [Y Z]" if meta["length"] else {int: "N", float: "X", str: "NAME"}[meta["kind"]]
    if meta["metavar"]:
        return meta["metavar"]
    return (
        tuple(name[0].upper() + str(n) for n in range(meta["length"][0])) if meta["length"] == (2,) else ("X", "Y", "Z")
    )


def _help(entry: Field[Any]) -> str:
    """Put a parameter's text, unit, limits and default into one line."""
    meta, default = entry.metadata, entry.default
    if isinstance(default, tuple):
        default = " ".join(f"{value:g}" for value in default)
    facts = [meta["unit"], "" if meta["choices"] else limits_of(entry)]
    facts += [] if default is None else [f"default {default:g}" if isinstance(default, float) else f"default {default}"]
    told = "; ".join(fact for fact in facts if fact)
    return (f"{meta['help']} ({told})" if told else str(meta["help"])).replace("%", "%%")


def _labels(text: str) -> tuple[int | str, ...]:
    """Take whole numbers, and names, which the label map is asked for."""
    return tuple(int(part) if part.strip().lstrip("+-").isdecimal() else part.strip() for part in text.split(","))


def _numbers(text: str) -> tuple[float, ...]:
    return tuple(float(part) for part in text.split(","))


# argparse names it where it fails: "invalid numbers, joined by commas, value"
_numbers.__name__ = "numbers, joined by commas,"
