"""What becomes of a finished mesh that is to be printed.

The thinnest wall of .8 mm is two lines of the usual nozzle of .4 mm.
"""

from __future__ import annotations

from dataclasses import dataclass

from .parameter import Group, param

SIDES = ("inferior", "superior", "anterior", "posterior", "left", "right")
"""Where down may be; of a cloud that knows no patient -z, +z, -y, +y, +x and -x."""


@dataclass(frozen=True)
class PrintSettings(Group):
    """Printing: a part in millimeters, and whether it can be printed."""

    scale: float = param(1.0, "size of the part over that of the object", above=0)
    flat_base: float | None = param(
        None, "cut the part flat this far above its lowest place, so that it stands", unit="mm", above=0
    )
    down: str = param(
        "inferior",
        "where down is: the side that is cut flat, and on which the part stands; for clouds -z, +z, -y, +y, +x, -x",
        choices=SIDES,
    )
    hollow: float | None = param(None, "leave a wall of this thickness around a cavity", unit="mm", above=0)
    drain: float | None = param(
        None, "diameter of a hole below the lowest place of every cavity, so that resin or powder can leave",
        unit="mm", above=0,
    )  # fmt: skip
    one_piece: bool = param(False, "leave out all pieces but the largest, with what floats free of the plate")
    fill_cavities: bool = param(False, "fill the cavities that have no way out")
    thicken: float | None = param(
        None,
        "thicken the walls that are thinner than this, about their middle; gaps as narrow close",
        unit="mm",
        above=0,
    )
    least_wall: float = param(
        0.8, "thinnest wall that the printer makes; a thinner one makes the part not printable", unit="mm", above=0
    )
    print_check: bool = param(False, "tell whether the mesh can be printed, as all other options of this group do too")

    @property
    def cuts(self) -> bool:
        """Whether a solid is to be cut."""
        return any(value is not None for value in (self.flat_base, self.thicken, self.hollow, self.drain))

    @property
    def asked(self) -> bool:
        """Whether there is to be a part, or a verdict."""
        return self.print_check or self.cuts or self.one_piece or self.fill_cavities or self.scale != 1
