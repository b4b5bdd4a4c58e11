"""Filter of a stream of feedback: one damaged frame changes nothing for good.

A checksum of one byte lets one damaged frame in 256 pass, more of those with two flipped bits.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

from robot.bases.kobuki_protocol.feedback import CoreSensors, Feedback, Inertia, Udid, Version
from robot.bases.kobuki_protocol.wheels import TICK_M, WHEEL_MAX_M_S

# Between two frames the wheels and the gyro move no further than this: the largest speed and a
# quarter more; 250 °/s, where the gyro saturates, and a fifth more
# (docs/reference/kobuki.md#odometry-and-gyro).
WHEEL_BOUND_M_S = 1.25 * WHEEL_MAX_M_S
TURN_BOUND_DEG_S = 300.0
SLACK_S = 0.01  # half a frame: sensors are read some time before their time stamp
# A base's clock may be ahead of ours by this since the frame before [s]: frames come in bursts.
AHEAD_S = 0.1
# After a longer silence [s] the base may have been switched off, and its counters start over
# (docs/reference/kobuki.md#odometry-and-gyro).
GAP_S = 1.0

BATTERY_NEAR = 2  # tenths of a volt between two frames that agree

AMPERES = 0.01  # one digit of a motor's current (docs/reference/kobuki.md#feedback)
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
        Bits as in ``CoreSensors``: set, and cleared, by two frames in a row.
    buttons
        Bits of the buttons that are held.
    current_a
        Current of both motors together [A], the lesser of two frames in a row; 0 where unknown.
    battery_v
        Voltage [V].
    is_charging
        Whether a charger is at it.
    restarted
        Whether the counters did not continue: at the first frame, and where the base was restarted,
        lost or carried away. Distances and heading go on from where they were.
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
    current_a: float = 0.0
    battery_v: float = math.nan
    is_charging: bool = False
    restarted: bool = False


class FrameFilter:
    """Turns a stream of decoded feedback into confirmed estimates.

    A frame whose encoders, gyro or time jump further than possible is held back; where the next one
    continues it, the base has restarted its counters. A bit that can stop, start or arm something
    changes once two accepted frames in a row agree on it: 20 ms after the first, also for hazards,
    which last longer than that. Versions, which are sent on request only, count once two replies
    agree, so they have to be requested until then.

    Attributes
    ----------
    doubted
        How many frames were held back.
    firmware, udid
        As the base reports them, once confirmed.
    """

    def __init__(self) -> None:
        self.doubted = 0
        self.firmware: Version | None = None
        self.udid: Udid | None = None
        self._estimate = Estimate()
        self._accepted: list[_Frame] = []  # the last two, the newest first
        self._doubted_frame: _Frame | None = None
        self._received_s = -math.inf
        self._unconfirmed: dict[str, Version | Udid] = {}

    def reset(self) -> None:
        """Start over with the next frames, as after the port was opened again."""
        self._accepted, self._doubted_frame = [], None
        self._unconfirmed.clear()
        self.firmware = self.udid = None

    def update(self, feedback: Feedback, now_s: float) -> Estimate | None:
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
        if now_s - self._received_s > GAP_S:
            self._accepted, self._doubted_frame = [], None
        self._received_s = now_s
        current_a = 0.0
        if feedback.current is not None:
            current_a = AMPERES * (feedback.current.left + feedback.current.right)
        now = _Frame(feedback.core, feedback.inertia, current_a, now_s, self._estimate)
        if self._accepted and now.repeats(self._accepted[0]):
            self.doubted += 1
            return None
        # Where it continues the last frame but one instead, the last one was damaged within bounds.
        for before in self._accepted:
            if now.continues(before):
                return self._accept(feedback, before, now)
        if self._doubted_frame is not None and now.continues(self._doubted_frame):
            self._accept(feedback, self._doubted_frame, now)
            self._estimate = replace(self._estimate, restarted=True)
            return self._estimate
        self.doubted += bool(self._accepted)
        self._doubted_frame = now
        return None

    def _confirm_versions(self, feedback: Feedback) -> None:
        for name in ("firmware", "udid"):
            version = getattr(feedback, name)
            if version is not None:
                if self._unconfirmed.get(name) == version:
                    setattr(self, name, version)
                self._unconfirmed[name] = version

    def _accept(self, feedback: Feedback, before: _Frame, now: _Frame) -> Estimate:
        self._confirm_versions(feedback)
        self._estimate = now.since(before)
        self._accepted = [replace(now, estimate=self._estimate), before]
        self._doubted_frame = None
        return self._estimate


@dataclass(frozen=True, slots=True)
class _Frame:
    """One frame, when it was received [s], and the estimate after it."""

    core: CoreSensors
    inertia: Inertia
    current_a: float
    received_s: float
    estimate: Estimate

    def repeats(self, before: _Frame) -> bool:
        """Return whether this is the same frame, sent again by the line."""
        return self.core == before.core and self.inertia == before.inertia

    def elapsed_s(self, before: _Frame) -> float:
        return _counter_difference(before.core.time_ms, self.core.time_ms) / 1000

    def distances_m(self, before: _Frame) -> tuple[float, float]:
        """Return how far the wheels have rolled, left and right [m]."""
        return (
            _counter_difference(before.core.left_ticks, self.core.left_ticks) * TICK_M,
            _counter_difference(before.core.right_ticks, self.core.right_ticks) * TICK_M,
        )

    def continues(self, before: _Frame) -> bool:
        """Return whether a base can have moved from there to here in the time between."""
        elapsed_s = self.elapsed_s(before)
        if not 0 < elapsed_s <= min(GAP_S, self.received_s - before.received_s + AHEAD_S):
            return False
        turned_deg = _angle_difference(before.inertia.angle, self.inertia.angle) * DEGREES
        return (
            max(map(abs, self.distances_m(before))) <= WHEEL_BOUND_M_S * (elapsed_s + SLACK_S)
            and abs(turned_deg) <= TURN_BOUND_DEG_S * (elapsed_s + SLACK_S)
            and abs(self.inertia.rate) * DEGREES <= TURN_BOUND_DEG_S
        )

    def since(self, before: _Frame) -> Estimate:
        """Return the estimate now, given a frame that this one continues."""
        was, core_was, core = before.estimate, before.core, self.core
        elapsed_s, (left_m, right_m) = self.elapsed_s(before), self.distances_m(before)
        turned = _angle_difference(before.inertia.angle, self.inertia.angle)
        agree_on_power = abs(core.battery - core_was.battery) <= BATTERY_NEAR
        agree_on_charger = core.is_charging == core_was.is_charging
        return Estimate(
            left_m=was.left_m + left_m,
            right_m=was.right_m + right_m,
            heading_rad=was.heading_rad + math.radians(turned * DEGREES),
            turn_rad_s=math.radians(self.inertia.rate * DEGREES),
            left_m_s=left_m / elapsed_s,
            right_m_s=right_m / elapsed_s,
            bumper=_debounce(was.bumper, core_was.bumper, core.bumper),
            wheel_drop=_debounce(was.wheel_drop, core_was.wheel_drop, core.wheel_drop),
            cliff=_debounce(was.cliff, core_was.cliff, core.cliff),
            over_current=_debounce(was.over_current, core_was.over_current, core.over_current),
            buttons=_debounce(was.buttons, core_was.buttons, core.buttons),
            current_a=min(before.current_a, self.current_a),
            battery_v=core.battery_v if agree_on_power else was.battery_v,
            is_charging=core.is_charging if agree_on_charger else was.is_charging,
        )


def _counter_difference(before: int, now: int) -> int:
    """Return the signed difference of a counter of 16 bits, which wraps."""
    return (now - before + 0x8000) % 0x10000 - 0x8000


def _angle_difference(before: int, now: int) -> float:
    """Return how far the gyro has turned [0.01°].

    Its angle is one modulo 360°, in 16 bits (docs/reference/kobuki.md#feedback): it may jump by
    360° or by 65536 digits, and neither is a turn.
    """
    return min(math.remainder(now - before, 36_000), _counter_difference(before, now), key=abs)


def _debounce(was: int, before: int, now: int) -> int:
    """Return the bits that two consecutive frames agree on, and the old ones elsewhere."""
    same = ~(before ^ now)
    return (now & same) | (was & ~same)
