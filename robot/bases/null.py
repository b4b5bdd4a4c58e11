"""No base at all: decisions are made and reported, nothing moves."""

from __future__ import annotations

from collections.abc import Callable
from typing import ClassVar

from robot.bases.base import Abilities, BaseState, MobileBase
from robot.motion.pose import HOME
from robot.motion.twist import STILL, Twist


class NullBase(MobileBase):
    """Stays at home, whatever is ordered."""

    name: ClassVar[str] = "null"
    abilities = Abilities(simulated=True, moves=False)

    def __init__(self, _monotonic: Callable[[], float]) -> None:
        pass

    def drive(self, twist: Twist) -> Twist:
        """Order nothing."""
        self.abilities.check(twist)
        return STILL

    def stop(self) -> None:
        """Do nothing: it always stands still."""

    def read(self) -> BaseState:
        """Return home, standing still."""
        return BaseState(HOME, STILL)

    def set_home(self) -> None:
        """Stay at home."""
