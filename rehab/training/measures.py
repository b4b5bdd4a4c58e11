"""What is trained: a quantity with its unit, direction and bounds."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

from robot.marking import Marked, TranslatableError, gettext_noop
from robot.plugins import Registry, check_one

GAIN_MIN = 0.5
GAIN_MAX = 1.5
# Beyond any unit of gait; sums over a session stay far from where floats overflow.
BOUND_MAX = 1e9
A2_SD = "a2_sd_w_kg"  # how sources call the standard deviation of A2
# The extra values by which a stride says that a sensor on that place measured it; each holds the
# version of the algorithm.
WORN = {"foot": "wearable_foot", "shank": "wearable_shank"}


class InvalidSetting(TranslatableError):
    """A setting that cannot be used; the message says what would be accepted."""


@dataclass(frozen=True, slots=True)
class Measure:
    """A quantity of a stride that can be trained.

    Attributes
    ----------
    slug, name, unit
        Its name in programs, its name for people (translated by pages), its values' unit.
    value_min, value_max
        Values lie in [value_min, value_max]; others are invalid.
    goal_min, goal_max
        Goals lie in (goal_min, goal_max], above 0, since a performance is a share of them.
    higher_is_better
        False for quantities that training should lower.
    channel
        The extra value of a step that holds it; "" for the step's own value.
    first_goal
        The goal that is offered where a patient has none yet.

    Raises
    ------
    InvalidSetting
        For bounds that leave no room.
    """

    slug: str
    name: str
    unit: str
    value_min: float
    value_max: float
    goal_min: float
    goal_max: float
    higher_is_better: bool = True
    channel: str = ""
    first_goal: float | None = None

    def __post_init__(self) -> None:
        if not -BOUND_MAX <= self.value_min < self.value_max <= BOUND_MAX:
            raise InvalidSetting(
                "{name}: the smallest value must lie below the largest.", name=Marked(self.name)
            )
        if not 0 <= self.goal_min < self.goal_max <= BOUND_MAX:
            raise InvalidSetting("{name}: goals need a range above 0.", name=Marked(self.name))
        if self.first_goal is not None:
            self.check_goal(self.first_goal)

    @property
    def sd_channel(self) -> str:
        """The extra value of a step that holds its value's standard deviation; "" without one."""
        return A2_SD if self.slug == "a2" and not self.channel else ""

    @property
    def typical_sd(self) -> float | None:
        """The standard deviation of its values where a step holds none; None where unknown."""
        return TYPICAL_SD.get(self.channel)

    @property
    def span(self) -> float:
        """How far below the goal a drawing's scale begins, as a share of the goal."""
        return SPANS.get(self.slug, 1.0)

    @property
    def goal_step(self) -> float:
        """By how much buttons raise a goal: 1, 2 or 5 of a decimal place, of 300 or more steps."""
        place = 10.0 ** math.floor(math.log10(self.goal_max / 300))
        return max(n * place for n in (1, 2, 5) if n * place <= self.goal_max / 300 * (1 + 1e-9))

    @property
    def goal_places(self) -> int:
        """Decimal places that a goal is given with."""
        return max(0, -math.floor(math.log10(self.goal_step)))

    @property
    def offered_goal(self) -> float:
        """The goal that is offered first: ``first_goal``, or the middle of the range."""
        if self.first_goal is not None:
            return self.first_goal
        return round((self.goal_min + self.goal_max) / 2, self.goal_places)

    @property
    def better(self) -> str:
        """Which way is better, and why where it is known (translated by pages)."""
        shipped = MEASURES.get(self.slug)
        if shipped is not None and shipped.higher_is_better == self.higher_is_better:
            return BETTER.get(self.slug, BETTER_ANY[self.higher_is_better])
        return BETTER_ANY[self.higher_is_better]

    def check_goal(self, goal: float) -> float:
        """Return the goal as a float. Raises InvalidSetting outside (goal_min, goal_max]."""
        if not self.goal_min < goal <= self.goal_max:
            raise InvalidSetting(
                "A goal of {goal:g} {unit} cannot be used for {name}. "
                "Give one above {least:g} and up to {most:g} {unit}.",
                goal=goal,
                unit=self.unit,
                name=Marked(self.name),
                least=self.goal_min,
                most=self.goal_max,
            )
        return float(goal)


def check_baseline_percent(percent: float) -> float:
    """Return a goal in percent of the baseline as a float. Raises InvalidSetting outside 50-200."""
    if not 50 <= percent <= 200:
        raise InvalidSetting(
            "A goal of {percent:g} % of baseline cannot be used. Give 50 to 200 %.",
            percent=percent,
        )
    return float(percent)


# These bounds are those of docs/reference/scoring.md#bounds. Healthy A2 lies at 2-6 W/kg; recorded
# outliers reach 13.75 W/kg (HEBB_03, force-plate faults), so 20 W/kg is a bound that only a wrong
# unit passes. The first goal is the mean of a healthy walk (docs/reference/gait.md#protocol).
A2 = Measure(
    slug="a2",
    name=gettext_noop("ankle push-off power A2"),
    unit="W/kg",
    value_min=0.0,
    value_max=20.0,
    goal_min=0.0,
    goal_max=15.0,
    first_goal=3.9,
)

# Of sensors on feet and shanks (docs/sources.md). Both contacts depend on where one sits, so each
# place has its own share of stance. Bounds are what no walking leg passes. Columns as in `_PLATES`.
_WORN = (
    ("foot_stance", gettext_noop("stance share (sensor on the foot)"), "%", "foot_stance_percent",
     20.0, 98.0, 95.0, 62.0, True),
    ("shank_stance", gettext_noop("stance share (sensor on the shank)"), "%",
     "shank_stance_percent", 20.0, 98.0, 95.0, 62.0, True),
    ("foot_swing", gettext_noop("swing share (sensor on the foot)"), "%", "foot_swing_percent",
     2.0, 80.0, 70.0, 38.0, True),
    ("shank_swing", gettext_noop("swing share (sensor on the shank)"), "%", "shank_swing_percent",
     2.0, 80.0, 70.0, 38.0, True),
    ("step_asymmetry", gettext_noop("difference of step times"), "%", "step_asymmetry_percent",
     0.0, 100.0, 80.0, 10.0, False),
    ("cadence", gettext_noop("cadence"), "1/min", "cadence_min", 15.0, 260.0, 200.0, 100.0, True),
    ("foot_strike", gettext_noop("foot strike angle"), "°", "foot_strike_deg",
     -60.0, 60.0, 45.0, 20.0, True),
    ("push_off_speed", gettext_noop("push-off speed of the foot"), "°/s", "push_off_deg_s",
     0.0, 1500.0, 1200.0, 400.0, True),
    ("shank_lean", gettext_noop("shank lean at toe-off"), "°", "shank_lean_deg",
     -30.0, 90.0, 80.0, 40.0, True),
)  # fmt: skip

# Of force plates and markers (docs/sources.md#other-measures): slug, name, unit, channel, the
# smallest and the largest value and the largest goal of walking, the first goal (a healthy
# walk's), whether more is better, and the standard deviation of a value against an independent
# computation (of whose distances nine in ten are within 1.64 of it).
_PLATES = (
    ("propulsion_peak", gettext_noop("propulsion (peak force)"), "N/kg", "propulsion_n_kg",
     0.0, 8.0, 6.0, 1.0, True, 0.01),
    ("propulsion_impulse", gettext_noop("propulsion (impulse)"), "N·s/kg",
     "propulsion_impulse_n_s_kg", 0.0, 3.0, 2.0, 0.25, True, 0.004),
    ("propulsion_share", gettext_noop("this leg’s share of propulsion"), "%", "propulsion_percent",
     0.0, 100.0, 100.0, 50.0, True, 0.3),
    ("braking_impulse", gettext_noop("braking (impulse)"), "N·s/kg", "braking_impulse_n_s_kg",
     0.0, 3.0, 2.0, 0.2, False, 0.004),
    ("step_length", gettext_noop("step length"), "m", "step_length_m",
     0.0, 1.8, 1.5, 0.5, True, 0.002),
    ("step_length_ratio", gettext_noop("step length by the other leg’s"), "%",
     "step_length_ratio_percent", 0.0, 500.0, 200.0, 100.0, True, 0.6),
    ("step_time", gettext_noop("step time"), "s", "step_s", 0.0, 4.0, 3.0, 0.6, False, 0.006),
    ("step_time_ratio", gettext_noop("step time by the other leg’s"), "%",
     "step_time_ratio_percent", 0.0, 500.0, 200.0, 100.0, False, 1.4),
    ("stance_ratio", gettext_noop("stance time by the other leg’s"), "%", "stance_ratio_percent",
     0.0, 500.0, 200.0, 100.0, True, 1.1),
    ("swing_ratio", gettext_noop("swing time by the other leg’s"), "%", "swing_ratio_percent",
     0.0, 500.0, 200.0, 100.0, False, 2.2),
    ("double_support", gettext_noop("double support"), "s", "double_support_s",
     0.0, 4.0, 3.0, 0.4, False, 0.014),
    ("trailing_limb", gettext_noop("trailing limb angle"), "°", "trailing_limb_deg",
     -60.0, 80.0, 60.0, 20.0, True, 0.2),
    ("knee_flexion", gettext_noop("knee flexion in swing"), "°", "knee_flexion_deg",
     -30.0, 160.0, 120.0, 60.0, True, 0.3),
    ("walking_ratio", gettext_noop("walk ratio"), "mm/(steps/min)", "walking_ratio_mm_min",
     0.0, 40.0, 20.0, 6.0, True, 0.03),
    ("margin", gettext_noop("margin of stability (backward)"), "m", "margin_m",
     -1.0, 1.0, 0.8, 0.08, True, 0.004),
)  # fmt: skip
PLATE_MEASURES, WORN_MEASURES = (
    tuple(
        Measure(slug, name, unit, least, most, 0.0, most_goal, is_more, channel, first_goal)
        for slug, name, unit, channel, least, most, most_goal, first_goal, is_more, *_ in rows
    )
    for rows in (_PLATES, _WORN)
)
TYPICAL_SD = {row[3]: row[-1] for row in _PLATES}
# Of measures that never come near 0: eight to ten of a leg's standard deviations after a stroke
# (stance share 1.2-2.7 % of the value, swing 2-8, cadence 2-5, push-off speed 5-10, lean 3-7;
# docs/sources.md), else nobody would see one stride differ from another.
SPANS = {
    "foot_stance": 0.2,
    "shank_stance": 0.2,
    "foot_swing": 0.4,
    "shank_swing": 0.4,
    "cadence": 0.3,
    "push_off_speed": 0.6,
    "shank_lean": 0.4,
}

MEASURES: Registry[Measure] = Registry(
    "garry.measures",
    {one.slug: one for one in (A2, *PLATE_MEASURES, *WORN_MEASURES)},
    check_one(Measure, "slug"),
)
# Which way one is better; of those that are shipped also why: read before the first stride.
BETTER_ANY = {True: gettext_noop("More is better."), False: gettext_noop("Less is better.")}
BETTER = {
    "a2": gettext_noop("More is better: the ankle pushes the body forward harder."),
    "foot_stance": gettext_noop("More is better: a weak leg often carries the body too briefly."),
    "shank_stance": gettext_noop("More is better: a weak leg often carries the body too briefly."),
    "foot_swing": gettext_noop("More is better: the other leg carries the body for longer."),
    "shank_swing": gettext_noop("More is better: the other leg carries the body for longer."),
    "step_asymmetry": gettext_noop("Less is better: both legs step in the same rhythm."),
    "cadence": gettext_noop("More is better: steps follow each other faster."),
    "foot_strike": gettext_noop("More is better: raised toes do not catch on the floor."),
    "push_off_speed": gettext_noop("More is better: the heel rises faster before the swing."),
    "shank_lean": gettext_noop("More is better: the leg stays behind the body for longer."),
    "propulsion_peak": gettext_noop("More is better: the leg drives the body forward harder."),
    "propulsion_impulse": gettext_noop("More is better: the leg drives the body forward harder."),
    "propulsion_share": gettext_noop("More is better: the weak leg does its part of the drive."),
    "braking_impulse": gettext_noop("Less is better: each landing slows the body less."),
    "step_length": gettext_noop("More is better: longer steps take the body further."),
    "step_length_ratio": gettext_noop("More is better: a short step comes up to the other leg’s."),
    "step_time": gettext_noop("Less is better: the leg steps through faster."),
    "step_time_ratio": gettext_noop("Less is better: a slow step comes up to the other leg’s."),
    "stance_ratio": gettext_noop("More is better: the weak leg carries as long as the other one."),
    "swing_ratio": gettext_noop("Less is better: the weak leg carries as long as the other one."),
    "double_support": gettext_noop("Less is better: the body moves from leg to leg faster."),
    "trailing_limb": gettext_noop("More is better: a leg behind the body can push it forward."),
    "knee_flexion": gettext_noop("More is better: the foot clears the floor more easily."),
    "walking_ratio": gettext_noop("More is better: fewer and longer steps at the same speed."),
    "margin": gettext_noop("More is better: there is more room before a fall backward."),
}
WORN_CHANNELS = {one.channel for one in WORN_MEASURES}


def check_worn(extra: Mapping[str, float], measure: Measure) -> None:
    """Raise InvalidSetting where a stride by a worn sensor would be scored as something else.

    Nothing on a foot or shank measures A2: no force and no moment is known there.
    """
    if measure.channel not in WORN_CHANNELS and not extra.keys().isdisjoint(WORN.values()):
        raise InvalidSetting(
            "A sensor on a foot or shank does not measure {name}. Start a session with one of its "
            "own measures, such as the foot strike angle.",
            name=Marked(measure.name),
        )


def check_gain(gain: float) -> float:
    """Return the gain as a float. Raises InvalidSetting outside [GAIN_MIN, GAIN_MAX]."""
    if not GAIN_MIN <= gain <= GAIN_MAX:
        raise InvalidSetting(
            "A gain of {gain:g} cannot be used. Give one from {least:g} to {most:g}.",
            gain=gain,
            least=GAIN_MIN,
            most=GAIN_MAX,
        )
    return float(gain)
