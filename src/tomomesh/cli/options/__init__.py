"""The parser of the command line, from the table of settings."""

from .parser import build_parser

__all__ = ["build_parser"]
