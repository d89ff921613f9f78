"""Every parameter once: its default, unit, limits, help text, and what the paper has instead.

The command line, the TOML file and the functions all read this table, so they cannot disagree.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import Field, asdict, dataclass, field, fields, replace
from typing import Any

from ..errors import UsageError
from .cloud import CloudSettings
from .crop import CropSettings
from .cubes import CubeSettings
from .fit import FitSettings
from .matters import MATTERS
from .network import FALLS, IN_SLICE, IN_SPACE, MOST_NEURONS, OF_STUDIES, SURFACES, NetworkSettings
from .parameter import LAYERS, MANY, UNSET, asked_by, limits_of, option_of
from .printing import PrintSettings
from .read import ReadSettings
from .run import RunSettings
from .schema import object_of, schema_of
from .spelled import differing, spelled
from .window import WindowSettings

__all__ = [
    "FALLS",
    "IN_SLICE",
    "IN_SPACE",
    "LAYERS",
    "MANY",
    "MATTERS",
    "MOST_NEURONS",
    "OF_STUDIES",
    "SURFACES",
    "UNSET",
    "CloudSettings",
    "CropSettings",
    "CubeSettings",
    "FitSettings",
    "NetworkSettings",
    "PrintSettings",
    "ReadSettings",
    "RunSettings",
    "Settings",
    "WindowSettings",
    "asked_by",
    "limits_of",
    "option_of",
    "parameters",
]


@dataclass(frozen=True)
class Settings:
    """All parameters of a run, in groups.

    Examples
    --------
    >>> from tomomesh import Settings
    >>> settings = Settings().replace(neurons=80, lower=200.0)
    >>> settings.network.neurons, settings.window.lower
    (80, 200.0)
    >>> Settings().network.neurons == settings.network.neurons
    False
    """

    read: ReadSettings = field(default_factory=ReadSettings)
    cloud: CloudSettings = field(default_factory=CloudSettings)
    crop: CropSettings = field(default_factory=CropSettings)
    window: WindowSettings = field(default_factory=WindowSettings)
    network: NetworkSettings = field(default_factory=NetworkSettings)
    cubes: CubeSettings = field(default_factory=CubeSettings)
    fit: FitSettings = field(default_factory=FitSettings)
    printing: PrintSettings = field(default_factory=PrintSettings)
    run: RunSettings = field(default_factory=RunSettings)

    @classmethod
    def for_paper(cls) -> Settings:
        """Return the paper's own choices."""
        return cls().by_the_paper()

    def by_the_paper(self) -> Settings:
        """Return the paper's choice wherever a parameter stands at its default."""
        groups = {entry.name: getattr(self, entry.name) for entry in fields(self)}
        return Settings(**{name: replace(group, **group.paper()) for name, group in groups.items()})

    @classmethod
    def from_dict(cls, sections: Mapping[str, Any], *, base: Settings | None = None, file: str = "") -> Settings:
        """Take sections of values, as a TOML file holds them, over the defaults or over `base`.

        Raises
        ------
        UsageError
            For a section or a key that there is not, or a value outside its limits.
        """
        base = base or cls()
        network = sections.get("network")
        if isinstance(network, Mapping) and network.get("way") == "paper":
            base = base.by_the_paper()
        known = {entry.name: getattr(base, entry.name) for entry in fields(cls)}
        for name, values in sections.items():
            keys = {f.name for f in fields(known[name])} if name in known else set()
            unknown = [key for key in values if key not in keys] if isinstance(values, Mapping) else [name]
            if unknown or name not in known:
                raise UsageError(
                    "the settings have no such entry",
                    file=file,
                    found=".".join([name, *unknown[:1]] if name in known else [name]),
                    expected="an entry of settings.toml",
                )
            known[name] = replace(known[name], **values)
        return cls(**known)

    def replace(self, **values: Any) -> Settings:
        """Change parameters by their bare names, whatever group they are in.

        Raises
        ------
        UsageError
            For a name that there is not, or a value outside its limits.
        """
        base = self.by_the_paper() if values.get("way") == "paper" != self.network.way else self
        groups = {entry.name: getattr(base, entry.name) for entry in fields(self)}
        for name, group in groups.items():
            own = {f.name: values.pop(f.name) for f in fields(group) if f.name in values}
            groups[name] = replace(group, **own)
        if values:
            raise UsageError("there is no such parameter", found=", ".join(values), expected="a field of Settings")
        return Settings(**groups)

    def words(self) -> list[str]:
        """Return the options of a command line by which these settings differ from the defaults.

        Examples
        --------
        >>> Settings().replace(lower=200.0, remesh=False).words()
        ['--lower', '200', '--no-remesh']
        """
        values = {name: value for group in fields(self) for name, value in vars(getattr(self, group.name)).items()}
        entries = {entry.name: entry for _, entry in parameters()}
        return [word for entry, value in differing(entries, values) for word in spelled(entry, value)]

    def to_dict(self) -> dict[str, dict[str, Any]]:
        """Return sections of values, those not set left out, as a TOML file holds them."""
        return {
            name: {key: _listed(value) for key, value in group.items() if value is not None}
            for name, group in asdict(self).items()
        }

    @classmethod
    def json_schema(cls) -> dict[str, Any]:
        """Return the JSON Schema (2020-12) of the sections that `from_dict` takes.

        Each parameter has its type, default, limits, choices, help text as ``description``, and, as annotations,
        its ``unit`` and the ``paper``'s value. Rules between parameters are checked by the settings alone. To JSON
        Schema 3.0 is an integer, to the settings it is none.

        Examples
        --------
        >>> Settings.json_schema()["properties"]["cubes"]["properties"]["low_pass"]["maximum"]
        1000
        """
        groups = {entry.name: schema_of(getattr(cls(), entry.name)) for entry in fields(cls)}
        dialect = "https://json-schema.org/draft/2020-12/schema"
        return object_of(groups, **{"$schema": dialect}, title="tomomesh settings", description=cls.__doc__)


def _listed(value: Any) -> Any:
    """Turn tuples into lists, however deep."""
    return [_listed(one) for one in value] if isinstance(value, tuple) else value


def parameters() -> Iterator[tuple[str, Field[Any]]]:
    """Yield every group's name with each of its parameters."""
    for group in fields(Settings):
        for entry in fields(getattr(Settings(), group.name)):
            yield group.name, entry
