"""How a part goes on beyond its last contour, and the volume of truncated cones.

Nothing is known beyond the last contour but that the next slice, a step away, does not have it. What is assumed: the
square of the part's thickness goes on as the parabola through the last three slices, which is exact for prisms, cones,
balls, ellipsoids and upright tori. Where it is 0 before the next slice, the part ends there. Else, with x the share of
the square that is lost until then, 0 for a prism, the part ends at (1 + x) / 2 of the step, all the flatter the less x
is, and encloses half a step times its area: the mean over all places where its true end may be.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

STEEPEST = 1e3
"""A power from which an end counts as flat: it rounds a thousandth of the reach off its edge."""


@dataclass(frozen=True)
class Ending:
    """The end of a part: of its squared thickness  1 - fall t - bend t^2 - rest t^power  is left, nothing at t = 1.

    Attributes
    ----------
    reach : float
        How far it goes on beyond the last contour; t is counted in shares of it.
    fall, bend, power : float
    """

    reach: float
    fall: float = 0.0
    bend: float = 0.0
    power: float = STEEPEST

    @classmethod
    def after(cls, step: float, fall: float, bend: float) -> Ending:
        """Return the end of a part.

        Parameters
        ----------
        step : float
            Distance to the slice that does not have it.
        fall, bend : float
            Of its squared thickness  1 - fall t - bend t^2  would be left at t steps, as `parabola` tells: bend is at
            least -fall^2 / 4, as a cone's.
        """
        if fall <= 0:
            return cls(step / 2)
        zero = pole(fall, bend)
        if zero <= 1:
            return cls(step * zero, fall * zero, bend * zero**2, 1.0)
        reach = (1 + fall + bend) / 2
        fall, bend, volume = fall * reach, bend * reach**2, (1 + (fall + bend) * bend / 3) / 2
        short = 1 - fall / 2 - bend / 3 - volume / reach
        rest = 1 - fall - bend
        return cls(step * reach, fall, bend, float(np.clip(rest / short - 1, 1, STEEPEST)) if short > 0 else STEEPEST)

    @property
    def rest(self) -> float:
        """Share of the squared thickness that is lost by the end alone."""
        return 1 - self.fall - self.bend

    @property
    def volume(self) -> float:
        """Return what it encloses, per area of its last contour."""
        return self.reach * (1 - self.fall / 2 - self.bend / 3 - self.rest / (self.power + 1))

    def inward(self, gap: float) -> float:
        """Return what its parabola encloses before it, over a gap, per area of its last contour."""
        t = gap / self.reach
        return gap * (1 + self.fall * t / 2 - self.bend * t * t / 3)

    def left(self, t: float) -> float:
        """Return the share of the squared thickness that is left at a share t of the reach; beyond, but for the end."""
        u = min(t, 1.0)
        lost = self.rest * t**self.power if t < 1 and self.power < STEEPEST else 0.0
        return max(1 - self.fall * u - self.bend * u * u - lost, 0.0)


def pole(fall: float, bend: float) -> float:
    """Return where nothing is left of  1 - fall t - bend t^2,  which falls no slower than a cone."""
    return float(2 / (fall + np.sqrt(max(fall**2 + 4 * bend, 0.0)))) if fall > 0 else np.inf


def parabola(gaps: tuple[float, ...], squares: tuple[float, ...]) -> tuple[float, float]:
    """Return fall and bend of  1 - fall t - bend t^2  through the squares that one or two slices before have.

    Parameters
    ----------
    gaps : tuple of float
        How far these slices are before the last one, rising.
    squares : tuple of float
        Their squared thickness, in squares of the last one's.

    Notes
    -----
    It falls no slower than a cone through the last two slices, which has a double zero in its tip.
    """
    slopes = [(square - 1) / gap for gap, square in zip(gaps, squares, strict=True)]
    bend = (slopes[0] - slopes[1]) / (gaps[1] - gaps[0]) if len(gaps) > 1 else 0.0
    fall = slopes[0] + bend * gaps[0]
    if fall**2 + 4 * bend >= 0 or squares[0] <= 1:
        return fall, bend
    tip = gaps[0] / (np.sqrt(squares[0]) - 1)
    return float(2 / tip), float(-1 / tip**2)


def frustum(below: float, above: float, gap: float) -> float:
    """Return the volume of a truncated cone between two areas."""
    return gap / 3 * (below + above + float(np.sqrt(below * above)))
