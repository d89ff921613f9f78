"""Take a page of ours apart, as a browser does."""

from __future__ import annotations

import base64
import hashlib
import re
from dataclasses import dataclass, field
from html.parser import HTMLParser

RUN = (None, "text/javascript", "module")
"""Types of scripts that a browser runs."""

HOSTILE = "</script><img src=x onerror=alert(1)>\"'&{{ 7*7 }}<!--"
"""A name that would be more than a text, were it not escaped."""


@dataclass
class Apart(HTMLParser):
    """The elements of a page, its texts, and what it would run or load."""

    elements: list[tuple[str, dict[str, str | None]]] = field(default_factory=list)
    inside: dict[str, list[str]] = field(default_factory=lambda: {"script": [], "style": []})
    texts: list[str] = field(default_factory=list)
    open: str = ""

    def __post_init__(self) -> None:
        super().__init__()

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.elements.append((tag, dict(attrs)))
        runs = tag == "style" or (tag == "script" and dict(attrs).get("type") in RUN)
        self.open = tag if runs else ""
        if runs:
            self.inside[tag].append("")

    def handle_endtag(self, tag: str) -> None:
        self.open = ""

    def handle_data(self, data: str) -> None:
        if self.open:
            self.inside[self.open][-1] += data
        else:
            self.texts.append(data)

    @property
    def policy(self) -> dict[str, list[str]]:
        """The Content Security Policy, each directive with its sources."""
        (told,) = [
            attrs["content"] or ""
            for tag, attrs in self.elements
            if tag == "meta" and attrs.get("http-equiv") == "Content-Security-Policy"
        ]
        return {name: sources for name, *sources in (part.split() for part in told.split(";"))}

    @property
    def text(self) -> str:
        """All that is read."""
        return "".join(self.texts)


def apart(page: str) -> Apart:
    """Take a page apart."""
    found = Apart()
    found.feed(page)
    found.close()
    return found


def hashes(texts: list[str]) -> list[str]:
    """Return the sources of a policy that let inline texts in."""
    return [f"'sha256-{base64.b64encode(hashlib.sha256(text.encode()).digest()).decode()}'" for text in texts]


def require_self_contained(page: str) -> Apart:
    """Check that a page lets nothing in but itself, and return its parts."""
    found = apart(page)
    policy = found.policy
    assert policy.pop("default-src") == policy.pop("base-uri") == policy.pop("form-action") == ["'none'"]
    assert policy.pop("img-src") == ["data:"]
    assert policy.pop("script-src") == hashes(found.inside["script"])
    assert policy.pop("style-src") == hashes(found.inside["style"])
    assert policy == {}
    for tag, attrs in found.elements:
        assert tag not in ("iframe", "object", "embed", "link", "base", "form")
        assert not [name for name in attrs if name == "style" or name.startswith("on")]
        assert (attrs.get("src") or "data:").startswith("data:")
        assert not re.match(r"[a-z+]*:|//", attrs.get("href") or "")
    assert not re.search(r"url\(|@import", "".join(found.inside["style"]))
    return found
