"""Networks: topology, training, what they see.

Where the numbers come from: 58 neurons, 10,000 presentations, random starts and the bubble are the paper's. A
learning rate from .5 to .01 by a power of 3 and a radius by a power of 5 came nearest to the true line of a band,
.186 of a pixel against .207 to 1.38 for other powers; the batch map needs 3 epochs from an ellipse and 10 from random
pixels; without the pixels beyond 2.5 medians a ring among 2 % strays is .07 of a pixel off, with them .48 (all
measured). A bridge is an edge of over two medians (docs, theory). More than 4,096 neurons would make the table of
hops, 4 bytes for each two, larger than 67 MB.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

from ..errors import UsageError
from .parameter import Group, param

SURFACES = ("sphere", "torus")
"""Networks with faces: closed surfaces, which live in space."""
OF_STUDIES = ("ring", "contours", "voxels", "sphere")
"""Ways from a study to a mesh, as they are asked for: one network a slice, several, none, or one in space."""
IN_SLICE, IN_SPACE = 58, 2562
"""Neurons where none are asked for: the paper's of a slice, and those of an icosahedron with edges divided 16-fold:
10 x 16^2 + 2."""
MOST_NEURONS = 4_096
"""Neurons of a slice at most."""
FALLS = ("linear", "power", "exponential", "inverse")
"""How a learning rate or a radius may fall."""


@dataclass(frozen=True)
class NetworkSettings(Group):
    """Self-organising maps (eq. 1, 2; Fig. 1), one a slice."""

    way: str = param(
        "auto",
        "what the surface is made from: a network on every slice (ring), one on every outline of a slice (contours), "
        "the boundary of the window's own voxels (voxels), or one network in space (sphere); paper is --paper; auto "
        "chooses from the pieces, holes and thickness of the window, and says so",
        choices=("auto", *OF_STUDIES, "paper"),
        paper="paper",
    )
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
        "auto",
        "topology of the network, by default a ring, or a sphere in space; none takes the window's boundary itself as "
        "the surface, at the places between the voxels where the gray levels cross the window's bounds (--way voxels)",
        choices=("auto", "chain", "ring", "grid", "hexagonal", "cylinder", "torus", "sphere", "none"),
    )
    space: str = param(
        "slice",
        "where networks live: one in each slice, or one in space over the voxels of the whole window (volume), as a "
        "sphere or a torus always does",
        choices=("slice", "volume"),
    )
    contours: str = param(
        "auto",
        "networks of a slice: one; a ring for each connected component of the window; two rings on the two sides of "
        "each wall; or a ring for every closed outline, holes included (loops), as --way contours has. Several share "
        "the neurons by length",
        choices=("auto", "one", "components", "walls", "loops"),
    )
    inputs: str = param(
        "pixels",
        "how often a pixel of a color slice is presented: once, or once for each layer that has it in its window, the "
        "layer being a third coordinate (eq. 4)",
        choices=("pixels", "layers"),
        paper="layers",
    )
    neurons: int | None = param(
        None, "neurons a slice; auto is what the length and the curvature of the outlines want for a ring in batch, "
        "58 for others, and 2562 in space", kind=int, low=3, high=MOST_NEURONS, auto=True,
    )  # fmt: skip
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
        if self.contours not in ("auto", "one") and (self.network not in ("auto", "ring") or self.in_space):
            raise UsageError(
                "several contours are rings",
                found=f"--contours = {self.contours}, --network = {self.network}, --space = {self.space}",
                expected="--network ring in slices, or --contours one",
            )
        one_ring = "ring" if self.way == "paper" else self.way
        if self.way != "auto" and self.detailed not in ("", one_ring):
            raise UsageError(
                "a way and its details are at odds", found=f"--way = {self.way}, {self.details}",
                expected=f"--way {self.detailed}, or no {self.details.split()[0]}",
            )  # fmt: skip

    @property
    def in_space(self) -> bool:
        """Whether one network is trained in space, and not one a slice."""
        return self.space == "volume" or self.network in SURFACES

    @property
    def topology(self) -> str:
        """The network that is trained: as asked, or a ring in each slice, or a sphere in space."""
        return ("sphere" if self.in_space else "ring") if self.network == "auto" else self.network

    @property
    def neurons_follow(self) -> bool:
        """Whether the number of neurons follows from the outlines; online, a ring's noise looks like curvature."""
        return self.neurons is None and self.topology == "ring" and self.training == "batch"

    @property
    def neuron_count(self) -> int:
        """Neurons of a network: as asked, or enough for a slice or for a surface."""
        return self.neurons or (IN_SPACE if self.in_space else IN_SLICE)

    @property
    def detailed(self) -> str:
        """The way that the details ask for, one of `OF_STUDIES`; "" where they leave it open."""
        if self.in_space:
            return "sphere"
        if self.network == "none":
            return "voxels"
        if self.contours not in ("auto", "one") or (self.network, self.way) == ("ring", "contours"):
            return "contours"
        return "ring" if (self.network, self.contours) != ("auto", "auto") else ""

    @property
    def details(self) -> str:
        """The details that are not left open, as options."""
        chosen = {"--network": self.network, "--contours": self.contours} | (
            {"--space": "volume"} if self.space == "volume" else {}
        )
        return ", ".join(f"{name} {value}" for name, value in chosen.items() if value != "auto")

    def taking(self, way: str) -> NetworkSettings:
        """Return these settings with a way, one of `OF_STUDIES`, and nothing about it left open."""
        network = {"voxels": "none", "sphere": "sphere"}.get(way, "ring") if self.network == "auto" else self.network
        several = self.contours if way == "contours" and self.contours not in ("auto", "one") else "loops"
        return replace(self, way=way, network=network, contours=several if way == "contours" else "one")
