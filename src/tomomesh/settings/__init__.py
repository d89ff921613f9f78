"""Every parameter once: its default, unit, limits, help text, and what the paper has instead.

The command line, the TOML file and the functions all read this table, so they cannot disagree.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import Field, asdict, dataclass, field, fields, replace
from typing import Any

from ..errors import UsageError
from .parameter import LAYERS, MANY, UNSET, Group, limits_of, option_of, param

__all__ = [
    "LAYERS",
    "MANY",
    "UNSET",
    "CubeSettings",
    "FitSettings",
    "NetworkSettings",
    "ReadSettings",
    "RunSettings",
    "Settings",
    "WindowSettings",
    "limits_of",
    "option_of",
    "parameters",
]


SURFACES = ("sphere", "torus")
"""Networks with faces: closed surfaces, which live in space."""
IN_SLICE, IN_SPACE = 58, 2562
"""Neurons where none are asked for: the paper's of a slice, and those of an icosahedron divided 16-fold."""
FALLS = ("linear", "power", "exponential", "inverse")
"""How a learning rate or a radius may fall."""


@dataclass(frozen=True)
class ReadSettings(Group):
    """How a study is read where its files leave a choice."""

    series: int | None = param(None, "number of the series to take from a folder that holds several", kind=int, low=0)
    spacing: tuple[float, ...] | None = param(
        None,
        "distance of the voxels along columns, rows and slices, for files that hold none",
        unit="mm",
        above=0,
        length=(3,),
    )
    spacing_z: float | None = param(
        None, "distance of the slices, for one slice or slices without positions", unit="mm", above=0
    )
    fill_gaps: bool = param(False, "interpolate the slices that are missing from a regular stack")


@dataclass(frozen=True)
class WindowSettings(Group):
    """Gray-level window (eq. 3): a voxel is kept where lower < k <= upper."""

    lower: float | tuple[float, ...] | None = param(
        None, "lowest gray level, itself left out, one or one a layer; Otsu's where not given",
        unit="stored, HU for CT", length=LAYERS,
    )  # fmt: skip
    upper: float | tuple[float, ...] | None = param(
        None, "highest gray level, itself kept, one or one a layer; no limit where not given",
        unit="stored, HU for CT", length=LAYERS,
    )  # fmt: skip
    layers: str = param(
        "all", "whether all layers of a color voxel must lie in their windows, or any", choices=("all", "any"),
        paper="any",
    )  # fmt: skip
    preset: str | None = param(
        None, "a window for CT: bone is k > 300 HU, skin is k > -300 HU", kind=str, choices=("bone", "skin")
    )
    select: tuple[int, ...] | None = param(
        None, "labels of a label map whose voxels are the window", kind=int, low=0, length=MANY
    )

    def __post_init__(self) -> None:
        super().__post_init__()
        for name in ("lower", "upper"):
            value = getattr(self, name)
            if isinstance(value, tuple) and len(value) == 1:
                object.__setattr__(self, name, value[0])
        limited = self.lower is not None or self.upper is not None
        if self.preset is not None and limited:
            raise UsageError("two windows are asked for", found="--preset and a window", expected="one of them")
        if self.select is not None and (limited or self.preset is not None):
            raise UsageError("two windows are asked for", found="--select and a window", expected="one of them")
        if self.lower is not None and self.upper is not None:
            self._check_limits(self.lower, self.upper)

    @staticmethod
    def _check_limits(*limits: float | tuple[float, ...]) -> None:
        lower, upper = (limit if isinstance(limit, tuple) else (limit,) for limit in limits)
        count = max(len(lower), len(upper))
        found = ", ".join(
            f"--{name} = {' '.join(f'{value:g}' for value in limit)}"
            for name, limit in (("lower", lower), ("upper", upper))
        )
        if len(lower) not in (1, count) or len(upper) not in (1, count):
            raise UsageError("the limits do not fit each other", found=found, expected="one, or as many as layers")
        pairs = zip(lower * (count // len(lower)), upper * (count // len(upper)), strict=True)
        if any(low >= high for low, high in pairs):
            raise UsageError("the window is empty", found=found, expected="lower < upper")


@dataclass(frozen=True)
class NetworkSettings(Group):
    """Self-organising maps (eq. 1, 2; Fig. 1), one a slice."""

    slices: str = param(
        "auto",
        "plane of the slices; auto is across the thickest spacing, axial where equal; a slab keeps its few slices",
        choices=("auto", "axial", "coronal", "sagittal", "stored"),
        paper="stored",
    )
    signal: str = param(
        "auto",
        "what the network sees: the window's pixels (region), the outline of the filled window (boundary), "
        "or the outline where the window is a solid and not a wall (auto)",
        choices=("region", "boundary", "auto"),
        paper="region",
    )
    network: str = param(
        "ring",
        "topology of the network; none takes the window's boundary itself as the surface, at the places between the "
        "voxels where the gray levels cross the window's bounds",
        choices=("chain", "ring", "grid", "hexagonal", "cylinder", "torus", "sphere", "none"),
    )
    space: str = param(
        "slice",
        "where networks live: one in each slice, or one in space over the voxels of the whole window (volume), as a "
        "sphere or a torus always does",
        choices=("slice", "volume"),
    )
    contours: str = param(
        "one",
        "networks of a slice: one; a ring for each connected component of the window; two rings on the two sides of "
        "each wall; or a ring for every closed outline, holes included (loops). Several share the neurons by length",
        choices=("one", "components", "walls", "loops"),
    )
    inputs: str = param(
        "pixels",
        "how often a pixel of a color slice is presented: once, or once for each layer that has it in its window, the "
        "layer being a third coordinate (eq. 4)",
        choices=("pixels", "layers"),
        paper="layers",
    )
    neurons: int | None = param(
        None, "neurons a slice, by default 58; of a network in space 2562", kind=int, low=3, high=4_096
    )
    training: str = param(
        "batch", "one presentation at a time, or all at once", choices=("online", "batch"), paper="online"
    )
    iterations: int = param(10_000, "online: presentations", unit="presentations", low=1)
    epochs: int = param(10, "batch: passes over all pixels", unit="passes", low=1)
    start: str = param(
        "ellipse",
        "start positions: the ellipse of the pixels, their principal axes, pixels drawn at random, or the result of "
        "the slice below (with --contours one; elsewhere as ellipse)",
        choices=("ellipse", "axes", "random", "neighbor"),
        paper="random",
    )
    neighborhood: str = param(
        "auto",
        "shape of the neighborhood; lateral is a bubble with inhibition around it and weak excitation beyond (Mexican "
        "hat); auto is gaussian in batch and bubble online, the better of each",
        choices=("auto", "bubble", "gaussian", "lateral"),
        paper="bubble",
    )
    alpha: tuple[float, float] = param((0.5, 0.01), "online: first and last learning rate", low=0, high=1, length=(2,))
    radius: tuple[float, float] | None = param(
        None,
        "first and last radius of the neighborhood (gaussian: its sigma); "
        "by default from half of the farthest hop down to 1, or for gaussian to what the region's thickness needs",
        unit="hops",
        low=0,
        length=(2,),
    )
    alpha_fall: str = param("power", "online: how the learning rate falls", choices=FALLS)
    radius_fall: str = param("power", "how the radius falls; not slower than the learning rate", choices=FALLS)
    alpha_power: float = param(3.0, "online: power of the learning rate's fall; 1 is linear", above=0)
    radius_power: float | None = param(
        None, "power of the radius' fall, by default 5 online and 2 in batch; 1 is linear", above=0
    )
    least_move: float = param(
        0.0, "stop when no neuron moves more than this in an epoch; 0 where none moves at all", unit="mm", low=0
    )
    bridge: float = param(
        2.0,
        "an edge of the network over this many medians is a bridged gap, sampled along its line; 0 finds none",
        unit="medians",
        low=0,
        paper=0.0,
    )
    even: bool = param(True, "space the neurons of a chain or ring evenly along their line", paper=False)
    trim: float = param(
        2.5,
        "pixels farther from their neuron than this many medians are strays, dropped in a second fit (batch); 0: none",
        unit="medians",
        low=0,
        paper=0.0,
    )

    def __post_init__(self) -> None:
        super().__post_init__()
        if 0 < self.trim < 1:
            raise UsageError(
                "--trim would drop most pixels", found=f"--trim = {self.trim:g}", expected="0 or at least 1"
            )
        if self.space == "volume" and self.network == "none":
            raise UsageError(
                "there is no network to be in space", found="--space = volume, --network = none",
                expected="a network, or --space slice",
            )  # fmt: skip
        if self.contours != "one" and (self.network != "ring" or self.in_space):
            raise UsageError(
                "several contours are rings",
                found=f"--contours = {self.contours}, --network = {self.network}, --space = {self.space}",
                expected="--network ring in slices, or --contours one",
            )

    @property
    def in_space(self) -> bool:
        """Whether one network is trained in space, and not one a slice."""
        return self.space == "volume" or self.network in SURFACES

    @property
    def neuron_count(self) -> int:
        """Neurons of a network: as asked, or enough for a slice or for a surface."""
        return self.neurons or (IN_SPACE if self.in_space else IN_SLICE)


@dataclass(frozen=True)
class CubeSettings(Group):
    """Space partition, cuberille and low-pass filter (Fig. 8)."""

    cell_mm: tuple[float, ...] | None = param(
        None, "edge of the cubes, one or one an axis (x y z), in a cloud's unit; by default what the points ask for",
        unit="mm", above=0, length=(1, 3),
    )  # fmt: skip
    cell_factor: float = param(1.0, "dilation factor on the edge of the cubes, for coarser models", above=0)
    caps: bool = param(True, "close the inside of rings that have nothing above or below")
    closing: int | None = param(
        None, "cubes by which gaps in the shell are closed; by default the fewest that keep the outside out",
        kind=int, unit="cubes", low=0, high=64,
    )  # fmt: skip
    stacks: str = param(
        "auto",
        "take points on parallel slices as contours, and close what lies between their insides; none never does",
        choices=("auto", "none"),
    )
    largest: bool = param(False, "keep the largest surface alone")
    allow_leaks: bool = param(False, "write the surface even where the outside leaks into the shell")
    open: bool = param(False, "write an open surface as a one-sided sheet with its borders")
    surface: str = param(
        "auto",
        "the outer surfaces, or all, with what lies in cavities; auto is outer, and all without a network",
        choices=("auto", "outer", "all"),
    )
    smoothing: int = param(3, "passes of the low-pass filter over the cuberille", unit="passes", low=0, high=1000)


@dataclass(frozen=True)
class FitSettings(Group):
    """Dynamic mass-spring mesh (eq. 5-7)."""

    attraction: str = param(
        "auto",
        "what draws a vertex: the nearest point, or the surface that the points around it describe; "
        "auto is the surface for clouds and the nearest point for networks",
        choices=("auto", "nearest", "surface"),
        paper="nearest",
    )
    stiffness: float = param(0.25, "sum of the structural stiffness at a vertex over k_d", low=0)
    damping: float = param(1.0, "damping over critical damping", above=0)
    step: float = param(0.8, "time step, in units of 1/omega; at most the damping and its inverse", above=0, high=1)
    tolerance: float = param(1e-3, "speed and acceleration at which the mesh rests", unit="cube edges", above=0)
    max_steps: int = param(200, "most steps", unit="steps", low=0)
    springs: str = param(
        "quads",
        "springs along the sides of squares or of triangles",
        choices=("quads", "triangles"),
        paper="triangles",
    )
    limit: str = param(
        "clamp",
        "where a vertex would move over one cube edge: clamp its step, or shorten the time step",
        choices=("clamp", "shorten"),
        paper="shorten",
    )

    def __post_init__(self) -> None:
        super().__post_init__()
        stable = min(self.damping, 1 / self.damping)
        if self.step > stable:
            raise UsageError(
                "the time step is above the stable limit",
                found=f"--step = {self.step:g}, --damping = {self.damping:g}",
                expected=f"--step at most {stable:g}, the smaller of --damping and its inverse",
            )


@dataclass(frozen=True)
class RunSettings(Group):
    """How to run; no result depends on the number of threads."""

    seed: int = param(0, "seed of everything drawn at random", low=0)
    threads: int = param(0, "threads; 0 is one a core", low=0, high=1024)
    units: str = param(
        "mm",
        "unit that the numbers of a cloud are in; studies are always in mm",
        choices=("mm", "cm", "m", "unknown"),
    )
    local_origin: bool = param(
        False, "count a cloud's coordinates from its lowest corner, which report and file name: for STL far from 0"
    )
    target_faces: int | None = param(
        None, "most faces of the mesh, which is made coarser where it has more", kind=int, unit="faces", low=4
    )


@dataclass(frozen=True)
class Settings:
    """All parameters of a run, in groups."""

    read: ReadSettings = field(default_factory=ReadSettings)
    window: WindowSettings = field(default_factory=WindowSettings)
    network: NetworkSettings = field(default_factory=NetworkSettings)
    cubes: CubeSettings = field(default_factory=CubeSettings)
    fit: FitSettings = field(default_factory=FitSettings)
    run: RunSettings = field(default_factory=RunSettings)

    @classmethod
    def for_paper(cls) -> Settings:
        """Return the paper's own choices."""
        groups = {entry.name: getattr(cls(), entry.name) for entry in fields(cls)}
        return cls(**{name: replace(group, **group.paper()) for name, group in groups.items()})

    @classmethod
    def from_dict(cls, sections: Mapping[str, Any], *, base: Settings | None = None, file: str = "") -> Settings:
        """Take sections of values, as a TOML file holds them, over the defaults or over `base`.

        Raises
        ------
        UsageError
            For a section or a key that there is not, or a value outside its limits.
        """
        known = {entry.name: getattr(base or cls(), entry.name) for entry in fields(cls)}
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
        groups = {entry.name: getattr(self, entry.name) for entry in fields(self)}
        for name, group in groups.items():
            own = {f.name: values.pop(f.name) for f in fields(group) if f.name in values}
            groups[name] = replace(group, **own)
        if values:
            raise UsageError("there is no such parameter", found=", ".join(values), expected="a field of Settings")
        return Settings(**groups)

    def to_dict(self) -> dict[str, dict[str, Any]]:
        """Return sections of values, those not set left out, as a TOML file holds them."""
        return {
            name: {key: list(v) if isinstance(v, tuple) else v for key, v in group.items() if v is not None}
            for name, group in asdict(self).items()
        }


def parameters() -> Iterator[tuple[str, Field[Any]]]:
    """Yield every group's name with each of its parameters."""
    for group in fields(Settings):
        for entry in fields(getattr(Settings(), group.name)):
            yield group.name, entry
