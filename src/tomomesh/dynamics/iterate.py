"""The one loop of every dynamic mesh: start, take steps, and stop where all is at rest."""

from __future__ import annotations

from typing import TYPE_CHECKING, Protocol, TypeVar

from ..model.trace import Motion, Trace

if TYPE_CHECKING:
    from ..progress import Progress

State = TypeVar("State")


class Integrator(Protocol[State]):
    """What takes a mesh from one state to the next."""

    def init(self) -> State:
        """Return the state in which the mesh starts, at rest."""

    def step(self, state: State, count: int) -> tuple[State, Motion]:
        """Return the state after one more step, `count` of them taken before, and how the mesh moved in it."""

    def rested(self, motion: Motion, count: int) -> bool:
        """Tell whether the mesh is at rest after `count` steps, the last of which moved it so."""


def iterate(integrator: Integrator[State], most: int, progress: Progress) -> tuple[State, Trace]:
    """Take steps until the mesh is at rest, or `most` of them.

    Parameters
    ----------
    integrator : Integrator
    most : int
    progress : callable

    Returns
    -------
    state : State
        After the last step.
    trace : Trace
        One entry a step; converged only where the integrator says so of the last one.
    """
    state, history, rested = integrator.init(), list[Motion](), False
    while len(history) < most and not rested:
        state, motion = integrator.step(state, len(history))
        history.append(motion)
        rested = integrator.rested(motion, len(history))
        progress("fit", len(history), most)
    steps = max(len(history), 1)
    progress("fit", steps, steps)
    return state, Trace.of(history, converged=rested)
