"""Whether something holds or pushes a base in a gesture. Time is a parameter.

Numbers without a source of their own are those of docs/reference/kobuki.md#beside-a-person.
"""

from __future__ import annotations

import math

from robot.bases.base import BaseState
from robot.motion.twist import Twist

# A wheel that deviates from what it should do now by more than a share of that, or by more than the
# least [m/s], whichever is more and up to the most [m/s], for some time [s]: it is held, lifted or
# pushed. A limit that did not follow the order would be blind to slow ones. (The most and the time
# are those of docs/reference/kobuki.md#beside-a-person, the rest is ours.)
DEVIATION_SHARE = 0.5
DEVIATION_LEAST_M_S, DEVIATION_M_S = 0.04, 0.1
DEVIATION_S = 0.5
# What it pushes against takes way from its wheels. So much of it [m] is the end, at any speed: with
# motors of 57 N (docs/reference/kobuki.md#twin) the work is below 1.7 J. It is forgiven within a
# second [s], for wheels slip a little everywhere. (Ours.)
MISSED_M, MISSED_FADES_S = 0.03, 1.0
# Wheels that slip miss no way, but their motors push. Rolling and speeding up take a TurtleBot 2
# less than this force [N]; so much work beyond it [J] is the end. (Ours.)
FREE_N, WORK_J = 12.0, 0.5


class Resistance:
    """What stood against a base in one gesture: by speed, by way, and by its motors' work."""

    def __init__(self) -> None:
        self._deviated_s: float | None = None  # for how long; None where it follows
        self._missed_m = self._work_j = 0.0

    def add(self, state: BaseState, ordered: Twist, span_s: float) -> bool:
        """Add what happened in the last moment, and return whether it is too much.

        Parameters
        ----------
        state
            What the base reports.
        ordered
            The order that it should follow now, given how late it answers.
        span_s
            How long ago the last moment was [s].
        """
        span_s = max(span_s, 0.0)
        *wheels, aside = zip(ordered.sides_m_s, state.twist.sides_m_s, strict=True)
        pairs = [*wheels, aside] if any(aside) else wheels
        deviation_m_s = max(abs(should - is_) for should, is_ in pairs)
        speed_m_s = max(abs(should) for should, _ in pairs)
        limit_m_s = min(max(DEVIATION_SHARE * speed_m_s, DEVIATION_LEAST_M_S), DEVIATION_M_S)
        if deviation_m_s <= limit_m_s:
            self._deviated_s = None
        else:
            self._deviated_s = 0.0 if self._deviated_s is None else self._deviated_s + span_s
        missing_m_s = max(
            math.copysign(1.0, want) * (want - have) if want else -abs(have) for want, have in pairs
        )
        self._missed_m *= math.exp(-span_s / MISSED_FADES_S)
        # One that is later than expected makes up for it afterwards.
        self._missed_m = max(self._missed_m + missing_m_s * span_s, 0.0)
        self._work_j += max(state.sensors.push_n - FREE_N, 0.0) * speed_m_s * span_s
        has_deviated = self._deviated_s is not None and self._deviated_s >= DEVIATION_S - 1e-9
        return has_deviated or self._missed_m > MISSED_M or self._work_j > WORK_J
