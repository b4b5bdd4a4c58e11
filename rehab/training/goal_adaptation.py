"""Goals that follow the patient: a goal to suggest, and a staircase that sets goals by itself.

Both aim at the share of hits that the PT wants. ``suggest_goal`` is the rule of the therapist's
page ("suggest", the goal coach); ``Staircase`` is the rule of automatic goals.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from enum import StrEnum

from rehab.training.measures import InvalidSetting, Measure
from robot.marking import gettext_noop

# Strides that a suggestion looks back on: about 20 s of the trained leg, as the PT's page shows.
SUGGESTION_STRIDES = 20
# Wanted where the PT has set no share: with a target of 70 % people held 62-64 % and stayed
# motivated (Metzger 2014, JNER 11:154).
DEFAULT_HIT_RATE = 0.7
# Beyond these a staircase would hardly ever see a miss or a hit to go by.
LEAST_HIT_RATE, MOST_HIT_RATE = 0.3, 0.9


class AdaptationMode(StrEnum):
    """How the goal changes while the patient walks."""

    OFF = gettext_noop("off")
    SUGGEST = gettext_noop("suggest")
    AUTOMATIC = gettext_noop("automatic")


def check_adaptation_mode(mode: object) -> AdaptationMode:
    """Return the mode of that name. Raises InvalidSetting, naming the known ones."""
    try:
        return AdaptationMode(mode)  # type: ignore[arg-type]  # any object may be looked up
    except ValueError:
        raise InvalidSetting(
            "Goals adapt in one of these ways: {known}.", known=", ".join(AdaptationMode)
        ) from None


@dataclass(frozen=True, slots=True)
class GoalAdaptation:
    """How goals follow the patient. The wanted share of hits is that of the session's target.

    Attributes
    ----------
    mode
        Off, suggested to the PT, or set by the staircase.
    limit
        How far the staircase may go from the goal that a person or the baseline set, as a share of
        it, up and down.
    strides
        Judged strides of a block of the staircase.
    step
        Size of its step for one stride, as a share of the goal.
    tolerance
        Half of the band about the wanted share in which the goal stays.

    Raises
    ------
    InvalidSetting
        For values out of bounds.
    """

    mode: AdaptationMode = AdaptationMode.SUGGEST
    limit: float = 0.2
    strides: int = 20
    step: float = 0.005
    tolerance: float = 0.1

    def __post_init__(self) -> None:
        if not 0 < self.limit <= 0.5:
            raise InvalidSetting(
                "Automatic goals stay within more than 0 and up to 50 % of the first one."
            )
        if not 5 <= self.strides <= 200:
            raise InvalidSetting("Automatic goals look at 5 to 200 strides at a time.")
        if not 0 < self.step <= 0.02:
            raise InvalidSetting("Automatic goals move by more than 0 and up to 2 % a stride.")
        if not 0 <= self.tolerance <= 0.3:
            raise InvalidSetting("Automatic goals keep the share of hits within 0 to 30 %.")

    def check_hit_rate(self, wanted: float | None) -> None:
        """Raise InvalidSetting for a wanted share of hits that the staircase cannot hold."""
        rate = DEFAULT_HIT_RATE if wanted is None else wanted
        if self.mode is AdaptationMode.AUTOMATIC and not LEAST_HIT_RATE <= rate <= MOST_HIT_RATE:
            raise InvalidSetting(
                "Automatic goals need a target hit rate of {least:g} to {most:g} % of the steps. "
                "Give such a rate, or let goals be suggested only.",
                least=100 * LEAST_HIT_RATE,
                most=100 * MOST_HIT_RATE,
            )


def suggest_goal(measure: Measure, shown: Sequence[float], hit_rate: float) -> float | None:
    """Return the goal that the latest strides would have reached as often as is wanted.

    Of n values, ``k = round(n × hit_rate)`` at least 1, are to reach the goal: it lies midway
    between the k-th best and the next one, the quantile of the sample that leaves k on its better
    side.

    Parameters
    ----------
    measure
        What is trained, with the bounds of its goals.
    shown
        What was shown of the latest valid strides, gain included, in the measure's unit.
    hit_rate
        Wanted share of hits (ratio, above 0 and up to 1).

    Returns
    -------
    float or None
        In the measure's unit; None with fewer than ``SUGGESTION_STRIDES`` values, and where the
        goal would lie outside of the measure's bounds.
    """
    values = sorted(shown[-SUGGESTION_STRIDES:], reverse=measure.higher_is_better)
    if len(values) < SUGGESTION_STRIDES:
        return None
    hits = max(1, math.floor(len(values) * hit_rate + 0.5))
    # Where all are to hit, as far beyond the weakest stride as the goal itself may lie: on it.
    goal = (values[hits - 1] + values[min(hits, len(values) - 1)]) / 2
    return goal if measure.goal_min < goal <= measure.goal_max else None


@dataclass(slots=True)
class Staircase:
    """A weighted up-down staircase over blocks of judged strides.

    Kaernbach (1991, Perception & Psychophysics 49:227-229): a step up of ``step × (1 − p)`` after a
    hit and one down of ``step × p`` after a miss balance where the share of hits is p. The steps of
    a block are put into force together at its end, so that the goal changes every 20 strides and
    not with each, and only where the block's share of hits left ``p ± tolerance``: for h hits of n,
    the goal becomes ``goal × (1 + step × (h − n × p))``, within ``limit`` of the anchor. Where
    lower is better the goal is divided instead.

    A goal that was set in any other way is the new anchor, and a new block begins with it; another
    gain begins a new block.

    Attributes
    ----------
    anchor
        The goal that bounds are counted from; None before the first stride.
    goal, gain, judged, hits
        Of the block that is under way.
    """

    anchor: float | None = None
    goal: float | None = None
    gain: float = 1.0
    judged: int = 0
    hits: int = 0

    def add(
        self,
        rule: GoalAdaptation,
        measure: Measure,
        hit_rate: float,
        *,
        goal: float,
        gain: float,
        hit: bool,
    ) -> float | None:
        """Count a judged stride, and return the goal from the next one on if it changes.

        Parameters
        ----------
        rule, measure, hit_rate
            The rule's figures, the bounds of goals, and the wanted share of hits (ratio).
        goal, gain, hit
            What the stride was judged by, and whether it was a hit.
        """
        if goal != self.goal:
            self.anchor = goal
        if goal != self.goal or gain != self.gain:
            self.goal, self.gain, self.judged, self.hits = goal, gain, 0, 0
        self.judged += 1
        self.hits += hit
        if self.judged < rule.strides:
            return None
        rate, excess = self.hits / self.judged, self.hits - self.judged * hit_rate
        self.judged = self.hits = 0
        # A hair wider than the band, so that 14 of 20 lie within 60 ± 10 % in binary figures too.
        if abs(rate - hit_rate) <= rule.tolerance + 1e-9:
            return None
        factor = 1 + rule.step * excess
        moved = goal * factor if measure.higher_is_better else goal / factor
        anchor = goal if self.anchor is None else self.anchor
        least, most = anchor * (1 - rule.limit), anchor * (1 + rule.limit)
        moved = min(max(moved, least), most, measure.goal_max)
        if moved == goal or not moved > measure.goal_min:
            return None
        self.goal = moved
        return moved
