"""XML from files: parsed without document types, which no format here has, and whose entities could grow."""

from __future__ import annotations

import io
from typing import Any
from xml.etree import ElementTree

from ...errors import FormatError
from .source import third_party

LONGEST_PROLOG = 4096
"""Bytes in which the first element begins."""


def parsed_xml(text: bytes, file: str, target: Any = None) -> Any:
    """Return the root of a text, or what a `target` of the parser's, told of each element in its turn, ends in.

    Raises
    ------
    FormatError
        Where it is no XML, or declares a document type.
    """
    _check_types(text, file)
    with third_party("xml", file):
        return ElementTree.fromstring(text, ElementTree.XMLParser(target=target))


def parsed_until(tag: str, text: bytes, file: str) -> Any:
    """Return the root of a text with what stands before the first element of a name.

    Raises
    ------
    FormatError
        As `parsed_xml`.
    """
    _check_types(text, file)
    root = None
    with third_party("xml", file):
        for _, element in ElementTree.iterparse(io.BytesIO(text), ("start",)):
            root = element if root is None else root
            if element.tag == tag:
                break
        return root


def _check_types(text: bytes, file: str) -> None:
    if b"\0" in text[:4]:  # UTF-16, which has a zero beside each letter
        text = text.replace(b"\0", b"")
    if b"<!DOCTYPE" in text[:LONGEST_PROLOG] or b"<!ENTITY" in text:
        raise FormatError("the XML declares a document type", file=file, expected="none, as the format has it")
