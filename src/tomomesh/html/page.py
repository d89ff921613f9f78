"""A page of one file: its scripts and styles within it, and a policy that lets in nothing else."""

from __future__ import annotations

import base64
import hashlib
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Any

from jinja2 import Environment, FileSystemLoader, StrictUndefined
from markupsafe import Markup

if TYPE_CHECKING:
    from collections.abc import Sequence

ASSETS = Path(__file__).parent / "assets"


@cache
def _templates() -> Environment:
    return Environment(
        loader=FileSystemLoader(ASSETS),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )


def asset(name: str) -> str:
    """Return the text of one of our scripts or styles."""
    return (ASSETS / name).read_text(encoding="utf-8")


def page(template: str, *, styles: Sequence[str], scripts: Sequence[str], **content: Any) -> str:
    """Fill a template.

    Parameters
    ----------
    template : str
        Its name in ``assets/``.
    styles, scripts : sequences of str
        CSS and classic scripts, each as an element of its own.
    **content
        What the template names; all of it is escaped.

    Returns
    -------
    str
        HTML that loads nothing, sends nothing, and runs only these scripts (Content Security Policy, level 3).
    """
    styles, scripts = ([_plain(one) for one in some if one] for some in (styles, scripts))
    filled = _templates().get_template(template).render(
        policy=policy(styles, scripts), styles=[*map(Markup, styles)], scripts=[*map(Markup, scripts)], **content
    )  # fmt: skip
    return f"{filled.rstrip()}\n"


def policy(styles: Sequence[str], scripts: Sequence[str]) -> str:
    """Return a Content Security Policy under which only these styles and scripts, and pictures in the page, work."""
    named = {"script-src": scripts, "style-src": styles}
    hashed = [f"{name} {' '.join(map(_hash, some)) or _NONE}" for name, some in named.items()]
    return "; ".join([f"default-src {_NONE}", *hashed, "img-src data:", f"base-uri {_NONE}", f"form-action {_NONE}"])


_NONE = "'none'"


def _hash(text: str) -> str:
    return f"'sha256-{base64.b64encode(hashlib.sha256(text.encode()).digest()).decode()}'"


def _plain(text: str) -> str:
    """Return a text with the ends of lines that a browser makes of all before it hashes them (HTML, 13.2.3.5)."""
    return text.replace("\r\n", "\n").replace("\r", "\n")
