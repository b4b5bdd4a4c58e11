"""A synthetic walker, one stride at a time.

The same seed gives the same walk on every machine and Python: chance comes from
``random.Random.random`` alone, whose sequence the standard library guarantees, and is turned into
strides by the four operations and a square root, which IEEE 754 rounds the same everywhere;
``exp``, ``log`` and ``pow`` are not in that class.
"""

from __future__ import annotations

import math
import random
from collections.abc import Iterator, Sequence

from rehab.sources.synthetic.profiles import ANSWERS, GOOD, FeedbackResponse, WalkerProfile
from rehab.training.phases import Phase, make_phase
from rehab.training.steps import InvalidReason, Measurement, Side

# The lab recorded trials of at most two minutes, with 3.2-5.2 s between them
# (docs/reference/gait.md#protocol).
TRIAL_S = 120.0
PAUSE_MIN_S = 3.2
PAUSE_MAX_S = 5.2
# Strides outside of this are no walking (docs/reference/gait.md#plausible-strides).
STRIDE_MIN_S = 0.5
STRIDE_MAX_S = 2.5


class SyntheticWalker:
    """A person who walks without end, one stride at a time, in constant memory.

    The caller says in which phase each stride is walked and gets one stride of the trained leg. A
    change of phase, and two minutes in one, begin a new trial after a short pause. What feedback
    shows is answered: learning leads to where the shown value exceeds the goal, by the feedback
    type's ``FeedbackResponse``; who hardly ever hits gives up some of the way.

    Attributes
    ----------
    goal_w_kg
        The goal that is shown [W/kg]; None for the walker's own baseline.
    valence
        The feedback type.
    """

    def __init__(
        self,
        profile: WalkerProfile,
        seed: int,
        side: Side = Side.LEFT,
        valence: str = "positive",
    ) -> None:
        self.profile = profile
        self.side = side
        self.goal_w_kg: float | None = None
        self.valence = valence
        self._random = random.Random(seed).random  # noqa: S311 (chance for walking, not for secrets)
        self._number = 0
        self._time_s = 0.0
        self._trial_end_s = 0.0
        self._phase: Phase | None = None
        self._slow = self._draw_normal()
        self._drift = math.sqrt(1 - profile.slow_phi * profile.slow_phi)  # keeps its sd at 1
        self._is_bad = False
        self._feedback_strides = 0
        self._plateau = profile.trained_level * (1 + profile.plateau_sd * self._draw_normal())
        self._level = profile.exploration_level  # with feedback, rested
        self._hit_rate = 0.5  # of the newest strides with feedback
        self._paces = [self._draw_normal() for _ in profile.pace_memory]
        self._pace_drifts = [math.sqrt(1 - one * one) for one in profile.pace_memory]
        self._pace_scales = [math.sqrt(share) for share in profile.pace_shares]
        self._pace_white = math.sqrt(max(0.0, 1 - math.fsum(profile.pace_shares)))
        self._uncoupled = math.sqrt(1 - profile.pace_coupling * profile.pace_coupling)
        self._unlearned = 1.0  # what of the way to the after-effect is still ahead
        self._unwashed = 1.0  # what of the after-effect washout has left
        self._fatigue = 0.0

    def next_stride(self, phase: Phase) -> Measurement:
        """Return the next stride, walked in a phase. ``time_s`` is the moment at which it ends."""
        profile = self.profile
        # Every stride draws the same numbers, whatever the phase: chance does not depend on rules.
        white, drift, pace = self._draw_normal(), self._draw_normal(), self._draw_normal()
        miss, bad, spike, factor, rest, slip, left = [self._random() for _ in range(7)]
        pace = self._next_pace(pace)
        if phase != self._phase or self._time_s >= self._trial_end_s:
            self._begin_trial(phase, rest)
        self._slow = profile.slow_phi * self._slow + self._drift * drift
        self._is_bad = bad < (profile.p_stay_bad if self._is_bad else profile.p_bad)
        noise, slow_sd = self._spread_in(phase)
        white = self._uncoupled * white + profile.pace_coupling * pace
        level = self._next_level(phase) + noise * white + slow_sd * self._slow
        value = max(0.0, profile.baseline_w_kg * level)
        if slip < profile.p_slip:
            value *= profile.slip_min + (profile.slip_max - profile.slip_min) * left
        if phase.feedback:
            self._see(phase, value)
        if self._is_bad and spike < profile.p_spike:
            value *= profile.spike_min + (profile.spike_max - profile.spike_min) * factor
        stride_s = profile.trained_stride_s if phase.feedback else profile.stride_s
        stride_s += profile.stride_sd_s * pace
        self._time_s += min(max(stride_s, STRIDE_MIN_S), STRIDE_MAX_S)
        self._number += 1
        is_missing = miss < profile.p_missing and not self._is_bad
        return Measurement(
            number=self._number,
            time_s=round(self._time_s, 3),
            side=self.side,
            value=None if is_missing else round(value, 4),
            reasons=(InvalidReason.FLAGGED,) if self._is_bad else (),
        )

    @property
    def _answer(self) -> FeedbackResponse:
        return ANSWERS.get(self.valence, FeedbackResponse())

    def _begin_trial(self, phase: Phase, rest: float) -> None:
        self._phase = phase
        if self._number:
            self._time_s += PAUSE_MIN_S + (PAUSE_MAX_S - PAUSE_MIN_S) * rest
        self._trial_end_s = self._time_s + TRIAL_S
        self._fatigue *= 1 - self.profile.recovery

    def _spread_in(self, phase: Phase) -> tuple[float, float]:
        """Return the sds of the white and the slow component, as ratios to the baseline."""
        profile = self.profile
        if phase.kind in ("familiarization", "catch"):
            return profile.brief_noise, profile.calm_slow_sd
        if phase.feedback:
            return profile.noise * self._answer.noise, profile.slow_sd
        return profile.calm_noise, profile.calm_slow_sd

    def _next_level(self, phase: Phase) -> float:
        """Return the mean that this stride varies about, as a ratio to the baseline."""
        profile = self.profile
        if phase.kind == "catch":
            return profile.catch_level
        if not phase.feedback:
            # In one stride, without a ramp (docs/reference/gait.md#dynamics).
            kept = profile.after_effect * self._answer.retention
            level = 1 + kept * (1 - self._unlearned) * self._unwashed
            if phase.kind == "washout":
                self._unwashed *= 1 - 1 / profile.after_effect_strides
            return level
        self._feedback_strides += 1
        self._unwashed = 1.0
        if self._feedback_strides > profile.exploration_strides:
            aim = self._find_aim(phase)
            rate = self._answer.learning / profile.learning_strides
            rate *= 1.0 if aim > self._level else profile.unlearning
            self._level += rate * (aim - self._level)
            self._unlearned *= 1 - self._answer.learning / profile.learning_strides
        self._fatigue += profile.fatigue_per_100_strides / 100
        if phase.kind == "familiarization":
            return profile.familiarization_level - self._fatigue
        return self._level - self._fatigue

    def _find_aim(self, phase: Phase) -> float:
        """Return the level that the display asks for, within what the walker can."""
        profile = self.profile
        goal = self.goal_w_kg or profile.baseline_w_kg
        asked = goal / profile.baseline_w_kg * profile.trained_gain / phase.gain
        aim = self._plateau * min(asked, profile.capacity)
        given_up = profile.discouragement * max(0.0, 1 - 5 * self._hit_rate)
        return aim - given_up * max(0.0, aim - 1)

    def _see(self, phase: Phase, value: float) -> None:
        """Take notice of whether a stride was shown as a hit."""
        is_hit = phase.gain * value >= (self.goal_w_kg or self.profile.baseline_w_kg)
        if self._feedback_strides > self.profile.exploration_strides:
            self._hit_rate += (is_hit - self._hit_rate) / 30

    def _next_pace(self, white: float) -> float:
        """Return the deviation of the next stride's time by its sd, which remembers the last."""
        total = self._pace_white * white
        for place, memory in enumerate(self.profile.pace_memory):
            drift = self._pace_drifts[place] * self._draw_normal()
            self._paces[place] = memory * self._paces[place] + drift
            total += self._pace_scales[place] * self._paces[place]
        return total

    def _draw_normal(self) -> float:
        """Return a standard normal number: twelve uniform ones less their mean.

        Tails end at ±6 sd. Written out, since ``sum`` rounds differently from Python 3.12 on.
        """
        draw = self._random
        low = draw() + draw() + draw() + draw() + draw() + draw()
        return low + draw() + draw() + draw() + draw() + draw() + draw() - 6.0


# One phase of each kind that a first session needs, the last without end.
DEFAULT_PHASES = (
    make_phase("baseline", strides=54),
    make_phase("familiarization", strides=30),
    make_phase("training"),
)


def walk(
    profile: WalkerProfile = GOOD,
    seed: int = 0,
    phases: Sequence[Phase] = DEFAULT_PHASES,
    strides: int | None = None,
    side: Side = Side.LEFT,
) -> Iterator[Measurement]:
    """Yield strides through phases until the last one is over or ``strides`` are walked.

    Phases end as ``SessionFold`` ends them, so that both always agree on a stride's phase.
    """
    walker = SyntheticWalker(profile, seed, side)
    left = math.inf if strides is None else strides
    last_s: float | None = None
    for phase in phases:
        phase_strides = 0
        phase_s = 0.0
        while left > 0 and not phase.is_over(phase_strides, phase_s):
            stride = walker.next_stride(phase)
            yield stride
            left -= 1
            phase_strides += 1
            phase_s += 0.0 if last_s is None else stride.time_s - last_s
            last_s = stride.time_s
