"""Where a volume is cut into slabs, and what of its layers, vertices and faces lies in each."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Cuts:
    """Layers cut into slabs, each as thick as one likes.

    Attributes
    ----------
    places : tuple of int
        The first layer of each slab, rising, and the one behind the last.

    Examples
    --------
    >>> cuts = Cuts.every(10, 4)
    >>> cuts.own
    [(0, 4), (4, 8), (8, 10)]
    >>> cuts.around(1, 3), cuts.beside(1, 5)
    ((1, 10), [0, 2])
    """

    places: tuple[int, ...]

    @classmethod
    def every(cls, layers: int, thickness: int) -> Cuts:
        """Cut so many layers into slabs of one thickness, the last of which may be thinner."""
        return cls((*range(0, layers, max(thickness, 1)), layers))

    def __len__(self) -> int:
        return len(self.places) - 1

    @property
    def own(self) -> list[tuple[int, int]]:
        """The layers of each slab, from the first to behind the last."""
        return list(zip(self.places, self.places[1:], strict=False))

    def around(self, slab: int, halo: int) -> tuple[int, int]:
        """Return the layers of a slab and so many on both sides of it, as far as there are any."""
        start, stop = self.own[slab]
        return max(start - halo, self.places[0]), min(stop + halo, self.places[-1])

    def beside(self, slab: int, halo: int) -> list[int]:
        """Return the other slabs that hold layers of the halo of one, in their order."""
        start, stop = self.around(slab, halo)
        return [n for n, (a, b) in enumerate(self.own) if n != slab and max(a, start) < min(b, stop)]
