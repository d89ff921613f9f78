"""XML from files: parsed without document types, which no format here has, and whose entities could grow."""

from __future__ import annotations

from xml.etree import ElementTree

from ...errors import FormatError
from .source import third_party

LONGEST_PROLOG = 4096
"""Bytes in which the first element begins."""


def parsed_xml(text: bytes, file: str) -> ElementTree.Element:
    """Return the root of a text.

    Raises
    ------
    FormatError
        Where it is no XML, or declares a document type.
    """
    if b"<!DOCTYPE" in text[:LONGEST_PROLOG] or b"<!ENTITY" in text:
        raise FormatError("the XML declares a document type", file=file, expected="none, as the format has it")
    with third_party("xml", file):
        return ElementTree.fromstring(text)
