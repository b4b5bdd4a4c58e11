"""The beat of a robot: 50 ticks a second."""

from __future__ import annotations

from collections.abc import Callable, Iterator

from robot.behavior.performer import Performer
from robot.motion.limits import TICK_S


def control_loop(
    performer: Performer,
    monotonic: Callable[[], float],
    is_over: Callable[[], bool] = lambda: False,
) -> Iterator[float]:
    """Tick a performer 50 times a second.

    The caller waits, by sleeping, by awaiting, or by moving a virtual clock, and may read the
    performer's state meanwhile.

    Parameters
    ----------
    performer
        The robot.
    monotonic
        The clock [s] that the performer is ticked by.
    is_over
        Called before each wait; the loop ends once it returns True.

    Yields
    ------
    float
        How long to wait until the next tick [s].

    Raises
    ------
    BaseLost
        Where the base does not answer any more.
    """
    while not is_over():
        yield TICK_S
        performer.tick(monotonic())
