"""A base and a gesture in a package of their own (docs/plugins.md)."""

from collections.abc import Callable
from typing import ClassVar

from robot.bases import Abilities, BaseState, MobileBase
from robot.motion.gesture import Gesture, Waypoint
from robot.motion.limits import ORDER_HOLDS_S, WHEEL_LIMITS
from robot.motion.pose import HOME, advance
from robot.motion.twist import STILL, Twist

PEEK = Gesture(
    "peek",
    "Peek: a little ahead, and back",
    (Waypoint(0.03, 0.0, 0.0, within_s=1.2), Waypoint(0.0, 0.0, 0.0, within_s=1.2)),
)


class Wagon(MobileBase):
    """Moves at once, by the clock that it is given."""

    name: ClassVar[str] = "wagon"
    abilities = Abilities(simulated=True, moves=True)

    def __init__(self, monotonic: Callable[[], float]) -> None:
        self._monotonic = monotonic
        self._pose, self._twist = HOME, STILL
        self._moved_s = self._until_s = monotonic()

    def _move(self) -> None:
        now_s = self._monotonic()
        driven_s = min(now_s, self._until_s) - self._moved_s
        self._pose = advance(self._pose, self._twist, max(0.0, driven_s))
        self._moved_s = now_s
        if now_s >= self._until_s:  # nobody has ordered anything for a while
            self._twist = STILL

    def drive(self, twist: Twist) -> Twist:
        """Order a velocity; one that is not finite is an order to stand still."""
        self.abilities.check(twist)
        self._move()
        self._twist = WHEEL_LIMITS.clip(twist)
        self._until_s = self._moved_s + ORDER_HOLDS_S
        return self._twist

    def stop(self) -> None:
        """Stand still at once."""
        self.drive(STILL)

    def read(self) -> BaseState:
        """Return where it is."""
        self._move()
        return BaseState(self._pose, self._twist)

    def set_home(self) -> None:
        """Make this place home."""
        self._move()
        self._pose = HOME
