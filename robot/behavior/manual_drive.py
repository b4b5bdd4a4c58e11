"""What a person orders who drives a robot to its place by a held button. Time is a parameter.

A dead man's switch: whoever lets go of it, or loses page or network, stops the robot. It drives
ahead and turns; it does not back up, since no bumper is behind it (docs/safety.md).
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

from robot.motion.twist import STILL, Twist
from robot.wire.frames import read_flag, read_number

# Our choice: half a gesture's speed and less, so that nobody is run into who steps in its way.
SPEED_M_S, TURN_RAD_S = 0.1, 0.5
HOLDS_S = 0.3  # a page that is held repeats its order every 0.1 s


class ManualDrive:
    """The order of the button that is held now."""

    def __init__(self) -> None:
        self._twist, self._ordered_s, self._is_home = STILL, -math.inf, False

    def order(self, message: Mapping[str, Any], now_s: float) -> None:
        """Store an order. Raises BadFrame.

        Parameters
        ----------
        message
            Shares of the speeds: ``ahead`` from 0 to 1, ``left`` from -1 to 1; with ``home`` true
            it finds its own way home.
        now_s
            The time [s].
        """
        ahead, left = read_number(message, "ahead", 0, 1), read_number(message, "left", -1, 1)
        is_home = read_flag(message, "home")
        self._twist, self._ordered_s = Twist(ahead * SPEED_M_S, left * TURN_RAD_S), now_s
        self._is_home = is_home

    def end(self) -> None:
        """Drop the order."""
        self._twist, self._is_home = STILL, False

    def twist(self, now_s: float) -> Twist:
        """Return what is ordered now; standing still where nobody holds the button."""
        return self._twist if self._is_held(now_s) else STILL

    def leads_home(self, now_s: float) -> bool:
        """Whether the button that is held now is the one that drives it home by its tag."""
        return self._is_home and self._is_held(now_s)

    def _is_held(self, now_s: float) -> bool:
        return 0 <= now_s - self._ordered_s <= HOLDS_S
