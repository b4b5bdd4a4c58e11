"""The strides of a leg as they are with one sign of its axis."""

from __future__ import annotations

import math
from collections import deque
from statistics import median

from rehab.gait.wearables.history import History
from rehab.gait.wearables.orientation import Vector
from rehab.gait.wearables.strides import (
    LOST_S,
    OFFSETS_S,
    SLOW_S,
    STRIDE_MAX_S,
    STRIDE_MIN_S,
    TURN_RAD,
    Doubt,
    Place,
    WearableStride,
)
from rehab.gait.wearables.swings import GAP_S, Swing, SwingDetector

STRIDES_JUDGED = 10
INTERRUPTED = 1.6  # times the usual stride: the person paused, or a swing was not found
# Times longer or shorter than the usual swing: the foot seems to land at another moment than usual.
# A leg that turns back before it lands does so (stroke_imu, pp01: by 0.2 to 0.4 s, which its foot
# does not); of 3,796 strides of the other shanks there 12 are marked.
SWING_UNLIKE = 1.5
SWINGS_MIN = 3  # from which on a swing is compared
STRIDES_HELD = 200  # at most, until the sign is known
# Of a stride; people after a stroke stand on a foot for up to 0.85 of it (stroke_imu).
STANCE_MIN, STANCE_MAX = 0.45, 0.92


class Reading:
    """Measures the strides that there are if the axis points left (sign 1) or right (-1)."""

    def __init__(self, sign: float, place: Place, history: History) -> None:
        self.sign = sign
        # Strides, each with the vertical in its stance.
        self.strides: deque[tuple[WearableStride, Vector]] = deque(maxlen=STRIDES_HELD)
        self.total = 0  # of its strides so far
        self._place, self._history = place, history
        self._swings = SwingDetector()
        self._contact_s = math.nan  # of the last initial contact, as a zero crossing
        self._motions: deque[float] = deque(maxlen=STRIDES_JUDGED)
        self._shares: deque[float] = deque(maxlen=STRIDES_JUDGED)
        self._lengths_s: deque[float] = deque(maxlen=STRIDES_JUDGED)
        self._swings_s: deque[float] = deque(maxlen=STRIDES_JUDGED)
        self._is_contact_unclear = False  # of the initial contact that ended the last stride

    @property
    def count(self) -> int:
        """How many strides it is judged by."""
        return len(self._motions)

    @property
    def motion_rad_s(self) -> float:
        """How much the leg moves in the middle of its stances: little, with the right sign."""
        return median(self._motions) if self._motions else math.inf

    @property
    def is_plausible(self) -> bool:
        """Whether stances last as long as people stand on a foot."""
        return bool(self._shares) and STANCE_MIN <= median(self._shares) <= STANCE_MAX

    def restart(self) -> None:
        """Wait for a new stride, as after a gap."""
        self._swings.restart()
        self._contact_s = math.nan
        self._is_contact_unclear = False

    def add(self, time_s: float, rate_rad_s: float, left: Vector, upright: Vector | None) -> None:
        """Add a sample that the history has been given; ``left`` is the axis with sign 1."""
        swing = self._swings.add(time_s, self.sign * rate_rad_s)
        if swing is None:
            return
        begin_s, self._contact_s = self._contact_s, swing.end_s
        if begin_s < swing.begin_s and STRIDE_MIN_S <= swing.end_s - begin_s <= STRIDE_MAX_S:
            self._measure(begin_s, swing, left, upright)

    def _measure(self, begin_s: float, swing: Swing, left: Vector, upright: Vector | None) -> None:
        """Measure the stride from one initial contact to that after the swing."""
        history, sign, leaves_s = self._history, self.sign, swing.begin_s
        initial_s, terminal_s = OFFSETS_S[self._place]
        stride = WearableStride(
            place=self._place,
            initial_contact_s=begin_s + initial_s,
            terminal_contact_s=leaves_s + terminal_s,
            stride_s=swing.end_s - begin_s,
            stance_s=leaves_s + terminal_s - begin_s - initial_s,
            reasons=self._find_doubts(begin_s, swing),
            rate_hz=1 / history.find_mean_step(begin_s, swing.end_s),
            foot_strike_rad=history.find_foot_strike(begin_s, leaves_s, sign)
            if self._place is Place.FOOT
            else None,
            push_off_rad_s=history.find_push_off(begin_s, leaves_s, sign)
            if self._place is Place.FOOT
            else None,
            shank_lean_rad=history.find_lean(
                leaves_s + terminal_s, upright, (sign * left[0], sign * left[1], sign * left[2])
            )
            if self._place is Place.SHANK and upright
            else None,
        )
        self.strides.append((stride, history.find_rest(begin_s, leaves_s)))
        self.total += 1
        self._shares.append(stride.stance_share)
        self._motions.append(history.find_motion(begin_s, leaves_s))

    def _find_doubts(self, begin_s: float, swing: Swing) -> tuple[Doubt, ...]:
        history = self._history
        doubts = []
        if history.find_turn(begin_s, swing.end_s) > TURN_RAD:
            doubts.append(Doubt.TURNING)
        contacts = (begin_s, swing.begin_s, swing.end_s)
        if any(history.find_longest_step(at - GAP_S, at + GAP_S) > LOST_S for at in contacts):
            doubts.append(Doubt.SAMPLES_LOST)
        length_s = swing.end_s - begin_s
        if self._lengths_s and length_s > INTERRUPTED * median(self._lengths_s):
            doubts.append(Doubt.INTERRUPTED)
        self._lengths_s.append(length_s)
        if history.find_mean_step(begin_s, swing.end_s) > SLOW_S:
            doubts.append(Doubt.LOW_RATE)
        was_unclear, self._is_contact_unclear = self._is_contact_unclear, self._is_unlike(swing)
        if was_unclear or self._is_contact_unclear:
            doubts.append(Doubt.CONTACT_UNCLEAR)
        return tuple(doubts)

    def _is_unlike(self, swing: Swing) -> bool:
        """Return whether a swing is much longer or shorter than this leg's latest ones."""
        swing_s = swing.end_s - swing.begin_s
        usual_s = median(self._swings_s) if len(self._swings_s) >= SWINGS_MIN else swing_s
        self._swings_s.append(swing_s)
        return max(swing_s / usual_s, usual_s / swing_s) > SWING_UNLIKE
