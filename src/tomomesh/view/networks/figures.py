"""The paper's Fig. 1 to 6 for a class: what is chosen for each, what is trained, and what is to be seen."""

from __future__ import annotations

from dataclasses import dataclass, fields
from typing import TYPE_CHECKING, Any

from ...settings import NetworkSettings

if TYPE_CHECKING:
    from collections.abc import Mapping


@dataclass(frozen=True)
class Figure:
    """A figure that can be played.

    Attributes
    ----------
    name, title, caption : str
    choices : dict
        Parameters of networks, beside which all others go back to their defaults; none where nothing is trained.
    region : str
        What is trained where no study is open, or where `own` is False.
    own : bool
        Whether it is of the study's own slice where one is open.
    shows : str
        network, regions, window or relief.
    """

    name: str
    title: str
    caption: str
    choices: Mapping[str, Any]
    region: str = "head"
    own: bool = False
    shows: str = "network"

    @property
    def told(self) -> dict[str, Any]:
        """What the page is told of it; null takes a parameter back to its default."""
        every = {entry.name: None for entry in fields(NetworkSettings)} if self.choices else {}
        values = {name: list(value) if isinstance(value, tuple) else value for name, value in self.choices.items()}
        return {**vars(self), "choices": {**every, **values}}


PAPER = {"way": "paper", "network": "ring"}
LOOSE = {"training": "online", "start": "random", "neighborhood": "bubble", "trim": 0.0}
"""The paper's training for a network that its way has not."""
TEN = {
    "neurons": 10, "training": "online", "iterations": 8, "neighborhood": "bubble", "alpha": (0.4, 0.4),
    "radius": (2.0, 2.0), "trim": 0.0, "even": False,
}  # fmt: skip
"""Fig. 1: ten neurons, a neighborhood of two; the learning rate is that of `tomomesh.show.topologies`."""
FIGURES = (
    Figure(
        "1a", "Update region of a chain",
        "An input (cross) is presented again and again. The nearest neuron wins (eq. 1), and those up to two links "
        "from it follow (eq. 2). The winner is the last but one: in a chain the neighborhood ends there, so four "
        "move.",
        {**TEN, "network": "chain"}, "input",
    ),
    Figure(
        "1b", "Update region of a ring",
        "The same input and the same ten neurons, but the last is linked to the first: in a ring the neighborhood goes "
        "on there, and a fifth neuron moves with the others.",
        {**TEN, "network": "ring"}, "input",
    ),
    Figure(
        "2", "A ring learns a triangle",
        "Fifty neurons start at random places: no start has to be known. While the neighborhood is wide the ring "
        "gathers and untangles; as it narrows, over 10,000 presentations, the ring spreads to fill the triangle.",
        {**PAPER, "neurons": 50}, "triangle",
    ),
    Figure(
        "3", "A slice is a matrix",
        "Each pixel has a gray level k, drawn here as a height. What is bright, as bone in the paper's, stands up; the "
        "rest lies lower: so a range of k cuts one tissue out of the image.",
        {}, own=True, shows="relief",
    ),
    Figure(
        "4", "The window on the gray levels",
        "Only pixels with LT < k <= HT are kept (eq. 3), here in blue; the paper's 200 to 255 keep the skull. Where "
        "they lie, and no longer how bright they are, is what the network is shown (eq. 4).",
        {}, own=True, shows="window",
    ),
    Figure(
        "5", "From the image to its regions",
        "Image, window, inputs, training, and at the end the network is compared with the image: each kept pixel has "
        "the color of the neuron nearest to it. Step through to see the regions take shape.",
        {**PAPER, "neurons": 24}, own=True, shows="regions",
    ),
    Figure(
        "6", "A ring on the skull",
        "Eighty neurons, 10,000 presentations, random start. Where the window is a wall, as the skull is, the ring "
        "thins it to one closed line, and its links cross the openings; through a solid it winds.",
        {**PAPER, "neurons": 80}, own=True,
    ),
    Figure(
        "Grid", "A grid in a square",
        "Beyond the paper's figures: an 8 x 8 grid unfolds. Its U-matrix shows how far neighbors are apart, its hits "
        "how many inputs each neuron has won: both grow more even as it does.",
        {**PAPER, "network": "grid", "neurons": 64}, "square",
    ),
    Figure(
        "Sphere", "A sphere in a cube",
        "Beyond the paper's figures: the same two equations in space. Drag to turn it.",
        {**LOOSE, "network": "sphere", "neurons": 162}, "cube",
    ),
)  # fmt: skip
