"""Filter of a stream of feedback: one damaged frame changes nothing for good.

A checksum of one byte lets one damaged frame in 256 pass, more of those with two flipped bits.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

from robot.bases.kobuki_protocol.feedback import CoreSensors, Feedback, Inertia, Udid, Version
from robot.bases.kobuki_protocol.wheels import TICK_M, WHEEL_MAX_M_S

# Between two frames the wheels and the gyro move no further than this: the largest speed and a
# quarter on top; 250 °/s, where the gyro saturates, and a fifth
# (docs/reference/kobuki.md#odometry-and-gyro).
WHEEL_BOUND_M_S = 1.25 * WHEEL_MAX_M_S
TURN_BOUND_DEG_S = 300.0
SLACK_S = 0.01  # half a frame: sensors are read some time before their time stamp
# A base's clock may run ahead of ours by so much since the frame before [s]: frames come in bursts.
AHEAD_S = 0.1
# After a longer silence [s] the base may have been switched off, and its counters start over
# (docs/reference/kobuki.md#odometry-and-gyro).
GAP_S = 1.0

BATTERY_NEAR = 2  # tenths of a volt between two frames that agree

DEGREES = 0.01  # one digit of the gyro's angle and rate (docs/reference/kobuki.md#feedback)


@dataclass(frozen=True, slots=True)
class Estimate:
    """State of a base after a frame, as far as it is confirmed.

    Parameters
    ----------
    left_m, right_m
        How far the wheels have rolled since the first frame [m].
    heading_rad, turn_rad_s
        Heading by the gyro since the first frame [rad], full turns included, and its rate [rad/s].
    left_m_s, right_m_s
        Speeds of the wheels since the frame before [m/s].
    bumper, wheel_drop, cliff, over_current
        Bits as in ``CoreSensors``: raised, and lowered, by two frames running.
    buttons
        Bits of the buttons that are held.
    pressed
        Bits of the buttons that came to be held with this frame.
    battery_v
        Voltage [V].
    is_charging
        Whether a charger is at it.
    began_anew
        The counters did not continue: the first frame, or the base was restarted, lost or carried
        off meanwhile. Distances and heading go on from where they were.
    """

    left_m: float = 0.0
    right_m: float = 0.0
    heading_rad: float = 0.0
    turn_rad_s: float = 0.0
    left_m_s: float = 0.0
    right_m_s: float = 0.0
    bumper: int = 0
    wheel_drop: int = 0
    cliff: int = 0
    over_current: int = 0
    buttons: int = 0
    pressed: int = 0
    battery_v: float = math.nan
    is_charging: bool = False
    began_anew: bool = False


class FrameFilter:
    """Turns a stream of decoded feedback into confirmed estimates.

    A frame whose encoders, gyro or time jump further than they can is put aside; where the next one
    continues it, the counters have begun anew. Whatever can stop, start or arm something counts
    once two believed frames running say it: 20 ms later than the first, and the same for hazards,
    which last longer than that. What is said only once in a while (versions) counts once two
    replies agree, so it has to be asked for until it does.

    Attributes
    ----------
    doubted
        How many frames were put aside.
    firmware, hardware, udid
        As the base says, once it is believed.
    """

    def __init__(self) -> None:
        self.doubted = 0
        self.firmware: Version | None = None
        self.hardware: Version | None = None
        self.udid: Udid | None = None
        self._estimate = Estimate()
        self._believed: list[_Frame] = []  # the last two, the newest first
        self._aside: _Frame | None = None
        self._heard_s = -math.inf
        self._claims: dict[str, Version | Udid] = {}

    def forget(self) -> None:
        """Start over with the next frames, as after the port was opened again."""
        self._believed, self._aside = [], None
        self._claims.clear()
        self.firmware = self.hardware = self.udid = None

    def take(self, feedback: Feedback, now_s: float) -> Estimate | None:
        """Add the next frame, and return the estimate, or None where the frame is not confirmed.

        Parameters
        ----------
        feedback
            The decoded frame.
        now_s
            When it was received, on a monotonic clock [s].
        """
        if feedback.core is None or feedback.inertia is None:
            return None
        if now_s - self._heard_s > GAP_S:
            self._believed, self._aside = [], None
        self._heard_s = now_s
        now = _Frame(feedback.core, feedback.inertia, now_s, self._estimate)
        if self._believed and now.repeats(self._believed[0]):
            self.doubted += 1
            return None
        # Where it continues the last frame but one instead, the last one was damaged within bounds.
        for before in self._believed:
            if now.continues(before):
                return self._believe(feedback, before, now)
        if self._aside is not None and now.continues(self._aside):
            self._believe(feedback, self._aside, now)
            self._estimate = replace(self._estimate, began_anew=True)
            return self._estimate
        self.doubted += bool(self._believed)
        self._aside = now
        return None

    def _hear_claims(self, feedback: Feedback) -> None:
        for name in ("firmware", "hardware", "udid"):
            said = getattr(feedback, name)
            if said is not None:
                if self._claims.get(name) == said:
                    setattr(self, name, said)
                self._claims[name] = said

    def _believe(self, feedback: Feedback, before: _Frame, now: _Frame) -> Estimate:
        self._hear_claims(feedback)
        seen, held = now.since(before), self._estimate.buttons
        self._estimate = replace(seen, pressed=seen.buttons & ~held)
        self._believed = [replace(now, estimate=self._estimate), before]
        self._aside = None
        return self._estimate


@dataclass(frozen=True, slots=True)
class _Frame:
    """One frame, when it was heard [s], and what was believed with it."""

    core: CoreSensors
    inertia: Inertia
    heard_s: float
    estimate: Estimate

    def repeats(self, before: _Frame) -> bool:
        """Return whether this is the same frame, sent again by the line."""
        return self.core == before.core and self.inertia == before.inertia

    def elapsed_s(self, before: _Frame) -> float:
        return _passed(before.core.time_ms, self.core.time_ms) / 1000

    def rolled_m(self, before: _Frame) -> tuple[float, float]:
        """Return how far the wheels have rolled, left and right [m]."""
        return (
            _passed(before.core.left_ticks, self.core.left_ticks) * TICK_M,
            _passed(before.core.right_ticks, self.core.right_ticks) * TICK_M,
        )

    def continues(self, before: _Frame) -> bool:
        """Return whether a base can have moved from there to here in the time between."""
        elapsed_s = self.elapsed_s(before)
        if not 0 < elapsed_s <= min(GAP_S, self.heard_s - before.heard_s + AHEAD_S):
            return False
        turned_deg = _turned(before.inertia.angle, self.inertia.angle) * DEGREES
        return (
            max(map(abs, self.rolled_m(before))) <= WHEEL_BOUND_M_S * (elapsed_s + SLACK_S)
            and abs(turned_deg) <= TURN_BOUND_DEG_S * (elapsed_s + SLACK_S)
            and abs(self.inertia.rate) * DEGREES <= TURN_BOUND_DEG_S
        )

    def since(self, before: _Frame) -> Estimate:
        """Return the estimate now, given a frame that this one continues."""
        was, core_was, core = before.estimate, before.core, self.core
        elapsed_s, (left_m, right_m) = self.elapsed_s(before), self.rolled_m(before)
        turned = _turned(before.inertia.angle, self.inertia.angle)
        agree_on_power = abs(core.battery - core_was.battery) <= BATTERY_NEAR
        agree_on_charger = core.is_charging == core_was.is_charging
        return Estimate(
            left_m=was.left_m + left_m,
            right_m=was.right_m + right_m,
            heading_rad=was.heading_rad + math.radians(turned * DEGREES),
            turn_rad_s=math.radians(self.inertia.rate * DEGREES),
            left_m_s=left_m / elapsed_s,
            right_m_s=right_m / elapsed_s,
            bumper=_agreed(was.bumper, core_was.bumper, core.bumper),
            wheel_drop=_agreed(was.wheel_drop, core_was.wheel_drop, core.wheel_drop),
            cliff=_agreed(was.cliff, core_was.cliff, core.cliff),
            over_current=_agreed(was.over_current, core_was.over_current, core.over_current),
            buttons=_agreed(was.buttons, core_was.buttons, core.buttons),
            battery_v=core.battery_v if agree_on_power else was.battery_v,
            is_charging=core.is_charging if agree_on_charger else was.is_charging,
        )


def _passed(before: int, now: int) -> int:
    """Return the signed difference of a counter of 16 bits, which wraps."""
    return (now - before + 0x8000) % 0x10000 - 0x8000


def _turned(before: int, now: int) -> float:
    """Return how far the gyro has turned [0.01°].

    Its angle is one modulo 360°, in 16 bits (docs/reference/kobuki.md#feedback): it may jump by
    360° or by 65536 digits, and neither is a turn.
    """
    return min(math.remainder(now - before, 36_000), _passed(before, now), key=abs)


def _agreed(was: int, before: int, now: int) -> int:
    """Return the bits that two consecutive frames agree on, and the old ones elsewhere."""
    same = ~(before ^ now)
    return (now & same) | (was & ~same)
