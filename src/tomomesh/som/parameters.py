"""Parameters as scikit-learn's tools want to see them, without scikit-learn."""

from __future__ import annotations

import inspect
from importlib import import_module
from typing import Any, Self

MOST = 60
"""Characters of a parameter up to which it is printed as it is."""


def _short(value: Any) -> str:
    """Return a value in one short line: an array by its shape."""
    told = repr(value)
    if len(told) <= MOST and "\n" not in told:
        return told
    shape = getattr(value, "shape", None) or (len(value) if hasattr(value, "__len__") else "")
    return f"<{type(value).__name__} {shape}>".replace(" >", ">")


class Parametrized:
    """An estimator whose parameters are those of its ``__init__``, kept under their own names."""

    def get_params(self, deep: bool = True) -> dict[str, Any]:
        """Return the parameters by their names."""
        return {name: getattr(self, name) for name in self._defaults()}

    def set_params(self, **params: Any) -> Self:
        """Change parameters by their names.

        Raises
        ------
        ValueError
            For a name that there is not.
        """
        for name, value in params.items():
            if name not in self._defaults():
                raise ValueError(f"Invalid parameter {name!r} for estimator {type(self).__name__}.")
            setattr(self, name, value)
        return self

    def __repr__(self) -> str:
        changed = [f"{name}={_short(getattr(self, name))}" for name, default in self._defaults().items()
                   if getattr(self, name) is not default and repr(getattr(self, name)) != repr(default)]  # fmt: skip
        return f"{type(self).__name__}({', '.join(changed)})"

    def __sklearn_is_fitted__(self) -> bool:
        return hasattr(self, "codebook_")

    def __sklearn_tags__(self) -> Any:
        theirs = import_module("sklearn.utils")
        return theirs.Tags(
            estimator_type=None,
            target_tags=theirs.TargetTags(required=False),
            transformer_tags=theirs.TransformerTags(),
        )

    @classmethod
    def _defaults(cls) -> dict[str, Any]:
        """Return the parameters with their defaults."""
        known = inspect.signature(cls).parameters
        return {name: entry.default for name, entry in known.items()}
