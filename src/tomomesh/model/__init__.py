"""Nouns: frozen dataclasses over plain arrays."""
