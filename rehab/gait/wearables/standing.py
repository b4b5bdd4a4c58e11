"""A leg that stands still, and the one movement that tells how its sensor is mounted."""

from __future__ import annotations

import math

from rehab.gait.wearables.axis import GRAVITY_M_S2
from rehab.gait.wearables.orientation import NOWHERE, Vector, dot, mix

STILL_RAD_S, STILL_M_S2 = 0.15, 0.4
STILL_S = 1.0
LIFT_RAD = (math.radians(10), math.radians(70))
BACK_RAD = math.radians(5)  # what a lift may turn the other way
LIFT_S = 3.0


class Standing:
    """Watches for stillness.

    Attributes
    ----------
    upright
        The vertical in the sensor's frame when the leg last stood still for a second; None before.
    """

    def __init__(self) -> None:
        self.upright: Vector | None = None
        self._still_s = 0.0
        self._mean = NOWHERE
        self._samples = 0
        self._rest_rad: float | None = None  # the angle at which the leg stood still
        self._least = self._most = 0.0
        self._moved_s = 0.0

    def add(
        self, step_s: float, speed_rad_s: float, acceleration: Vector | None, up: Vector,
        angle_rad: float,
    ) -> float | None:  # fmt: skip
        """Add a sample; return the sign of a rotation out of stillness and back, when it ends.

        That is how a patient answers when asked to lift the toes once (a sensor on the foot) or to
        swing the lower leg forward once (on the shank): 1 where the angle rose, else -1. A step
        turns a leg both ways and is none.
        """
        shaken = (
            0.0
            if acceleration is None
            else abs(math.sqrt(dot(acceleration, acceleration)) - GRAVITY_M_S2)
        )
        if speed_rad_s > STILL_RAD_S or shaken > STILL_M_S2:
            self._still_s, self._samples = 0.0, 0
            self._moved_s += step_s
            if self._rest_rad is not None:
                turned = angle_rad - self._rest_rad
                self._least, self._most = min(self._least, turned), max(self._most, turned)
            return None
        self._still_s += step_s
        self._samples += 1
        self._mean = mix(self._mean, up, 1 / self._samples)
        if self._still_s < STILL_S:
            return None
        if acceleration is not None:
            self.upright = self._mean
        answer = self._judge()
        self._rest_rad, self._least, self._most, self._moved_s = angle_rad, 0.0, 0.0, 0.0
        return answer

    def _judge(self) -> float | None:
        up, down = self._most, -self._least
        if self._rest_rad is None or self._moved_s > LIFT_S or min(up, down) > BACK_RAD:
            return None
        if not LIFT_RAD[0] <= max(up, down) <= LIFT_RAD[1]:
            return None
        return 1.0 if up > down else -1.0
