"""What a base reports, for all who ask; nothing that it felt is lost between two of them."""

from __future__ import annotations

from dataclasses import replace

from robot.bases import BaseState, MobileBase
from robot.motion.pose import HOME
from robot.motion.twist import STILL


class Senses:
    """Reads a base. Nothing else may: a base keeps a hazard until it is read, and no longer.

    Parameters
    ----------
    base
        An open base.

    Attributes
    ----------
    state
        What it reported last; before that, home.
    """

    def __init__(self, base: MobileBase) -> None:
        self._base = base
        self._felt: frozenset[str] = frozenset()  # hazards since the last judgment
        self._pressed = False  # its stop button, likewise
        self.state = BaseState(HOME, STILL)

    def read(self) -> BaseState:
        """Return the state now, with what it felt since the last judgment. Raises BaseLost."""
        state = self._base.read()
        self._felt |= state.sensors.hazards
        self._pressed |= state.sensors.stop_pressed
        sensors = replace(state.sensors, hazards=self._felt, stop_pressed=self._pressed)
        self.state = replace(state, sensors=sensors)
        return self.state

    def judge(self) -> BaseState:
        """Return the state like ``read``, to the one who stops the base for its hazards."""
        state = self.read()
        self._felt, self._pressed = frozenset(), False
        return state
