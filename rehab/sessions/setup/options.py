"""The registry of set-up options: an entry for each thing that is chosen when a session is set up.

From an entry follow the option's field in the set-up and in presets, its part of the plan, what
"like last time" offers, its field in the API, its column in exports and its line in the codebook.
Patient, leg, station, measure and protocol are no options: they are rows, or follow from one.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Mapping
from enum import StrEnum
from typing import Any

from django.utils.text import capfirst
from django.utils.translation import gettext_lazy as _

from rehab.feedback.translation import valence_choices
from rehab.people.models import User
from rehab.sessions.formatting import format_source
from rehab.sessions.setup.gestures import DEFAULT_GESTURE, robot_gesture_choices
from rehab.sessions.setup.option import (
    MINUTES,
    PERCENT,
    Conversion,
    Group,
    Option,
    OptionColumn,
)
from rehab.sessions.setup.sources import LIVE, source_choices
from rehab.sessions.setup.walking import (
    BELT_M_S,
    MAX_DEVICE_LETTERS,
    SUPPORT_PERCENT,
    WalkingConditions,
)
from rehab.training.adaptation import AdaptationMode, GoalAdaptation
from rehab.training.changes import ChangeKind
from rehab.training.cueing import DEFAULT_ACTIVATION_THRESHOLD, CueTiming
from rehab.training.goals import GoalRule, Target
from rehab.training.measures import A2
from rehab.training.plans import ROBOT_LEVELS, name_robot_level
from rehab.training.schedules import INTERVAL_MAX, Schedule, ScheduleKind
from rehab.training.valences import POSITIVE
from robot.wire.cue_limits import (
    COUNT_MAX,
    REST_MAX_S,
    WINDOW_MAX_S,
    WINDOW_MIN_S,
    CueRule,
)

GOAL_KINDS = ("value", "percent")
# The paper's example of a goal for a whole session (docs/reference/original.md#goal-of-a-session):
# 60 % of the steps, ten minutes.
WANTED_HITS_PERCENT = 60
PLANNED_MINUTES = 10
# The parts of a session that options build; each other place is a value of its own.
PARTS: dict[str, type] = {
    "goal": GoalRule,
    "target": Target,
    "cue_timing": CueTiming,
    "schedule": Schedule,
    "adaptation": GoalAdaptation,
    "walking": WalkingConditions,
}
# Groups of the options that say when page and robot answer, and whether the goal follows.
ANSWERS = (Group.GOAL, Group.FEEDBACK, Group.ROBOT)
_CUE, _SCHEDULE = CueTiming(), Schedule()


def _list_sources(_by: User | None) -> list[tuple[str, str]]:
    return [(name, format_source(label)) for name, label in source_choices()]


def _list_gestures(by: User | None) -> list[tuple[str, Any]]:
    return [] if by is None else robot_gesture_choices(by)


OPTIONS: dict[str, Option] = {
    option.name: option
    for option in (
        Option(
            name="valence",
            api_name="feedback_type",
            label=_("Feedback type"),
            help="The rule set of feedback.",
            kind=str,
            choices=lambda _by: valence_choices(),
            is_radio=True,
            default=POSITIVE.slug,
            is_required=True,
            place="valence.slug",
            is_derived=True,
        ),
        Option(
            name="goal_by",
            label=capfirst(_("goal is given as")),
            help="Follows from `goal` or `goal_percent`.",
            kind=str,
            choices=[("value", _("value")), ("percent", _("% of baseline"))],
            is_radio=True,
            default="percent",
            is_required=True,
            place="goal.needs_baseline",
            is_derived=True,
            conversion=Conversion(GOAL_KINDS.index, GOAL_KINDS.__getitem__),
        ),
        Option(
            name="goal_value",
            api_name="goal",
            label=capfirst(_("goal, in the measure's unit")),
            help="In the measure's unit, or give `goal_percent`.",
            kind=float,
            nullable=True,
            default=A2.offered_goal,
            place="goal.value",
            applies_to=("goal_by", ("value",)),
        ),
        Option(
            name="goal_percent",
            label=capfirst(_("goal, % of baseline")),
            help="Percent of the baseline.",
            kind=float,
            nullable=True,
            default=100,
            least=50,
            most=200,
            unit="%",
            place="goal.percent_of_baseline",
            applies_to=("goal_by", ("percent",)),
        ),
        Option(
            name="wanted_hits",
            label=capfirst(_("wanted hits, % of the steps")),
            help="Percent of the steps.",
            kind=int,
            nullable=True,
            default=WANTED_HITS_PERCENT,
            least=1,
            most=100,
            unit="%",
            place="target.hit_rate",
            conversion=PERCENT,
            column=OptionColumn(
                "wanted_hit_rate", "ratio", "Share of steps at the goal that the therapist wanted."
            ),
        ),
        Option(
            name="minutes",
            label=_("Planned minutes"),
            help="Planned time of walking.",
            kind=int,
            nullable=True,
            default=PLANNED_MINUTES,
            least=1,
            most=240,
            unit=_("minutes"),
            place="target.duration_s",
            conversion=MINUTES,
            column=OptionColumn("planned", "s", "Planned time of walking."),
        ),
        Option(
            name="source",
            label=_("Steps come from"),
            help="`live`, `synthetic good`, `recording walk.csv`, …",
            kind=str,
            choices=_list_sources,
            is_radio=True,
            default=LIVE,
            is_required=True,
        ),
        Option(
            name="robot",
            label=_("Robot"),
            help="How lively it is.",
            kind=str,
            choices=[(level, capfirst(_(level))) for level in ROBOT_LEVELS],
            is_radio=True,
            default="normal",
            is_required=True,
            place="robot_intensity",
            conversion=Conversion(ROBOT_LEVELS.__getitem__, name_robot_level),
            control=ChangeKind.ROBOT_INTENSITY,
        ),
        Option(
            name="robot_above",
            label=_("After strong steps"),
            help="Gesture after a window above the threshold.",
            kind=str,
            choices=_list_gestures,
            default=DEFAULT_GESTURE,
            is_required=True,
            place="valence.cue.above",
            is_derived=True,
        ),
        Option(
            name="robot_below",
            label=_("After weak steps"),
            help="Gesture after a window below it.",
            kind=str,
            choices=_list_gestures,
            default=DEFAULT_GESTURE,
            is_required=True,
            place="valence.cue.below",
            is_derived=True,
        ),
        Option(
            name="goal_follows",
            label=_("The goal"),
            help="Whether the goal stays, is suggested or follows by itself.",
            kind=AdaptationMode,
            choices=[
                (AdaptationMode.OFF.value, _("stays")),
                (AdaptationMode.SUGGEST.value, _("is suggested")),
                (AdaptationMode.AUTOMATIC.value, _("follows by itself")),
            ],
            default=GoalAdaptation().mode.value,
            place="adaptation.mode",
            control=ChangeKind.GOAL_ADAPTATION,
            group=Group.GOAL,
            column=OptionColumn("goal_follows", "", "off, suggest or automatic, as it began."),
        ),
        Option(
            name="goal_asks",
            label=_("Ask before the baseline’s goal counts"),
            help="Whether a therapist accepts the baseline's goal before it counts.",
            kind=bool,
            default=False,
            place="goal.asks",
            group=Group.GOAL,
        ),
        Option(
            name="schedule",
            label=_("Feedback comes"),
            help="After which steps the patient gets feedback.",
            kind=ScheduleKind,
            choices=[
                (ScheduleKind.EVERY.value, _("after every step, or every so many")),
                (ScheduleKind.BANDWIDTH.value, _("only outside of a band about the goal")),
                (ScheduleKind.FADED.value, _("more and more rarely")),
                (ScheduleKind.SUMMARY.value, _("as a summary of so many steps")),
            ],
            default=_SCHEDULE.kind.value,
            place="schedule.kind",
            group=Group.FEEDBACK,
            column=OptionColumn(
                "schedule", "", "When the patient got feedback: every, bandwidth, faded or summary."
            ),
        ),
        Option(
            name="schedule_steps",
            label=_("Steps between feedback"),
            help="Feedback after each so many steps; of `faded` the most, of `summary` the block.",
            kind=int,
            default=_SCHEDULE.interval,
            least=1,
            most=INTERVAL_MAX,
            place="schedule.interval",
            group=Group.FEEDBACK,
            applies_to=("schedule", ("every", "faded", "summary")),
            column=OptionColumn(
                "schedule_steps", "", "Steps from one time to the next (of faded: at most)."
            ),
        ),
        Option(
            name="schedule_band",
            label=_("Band without feedback, ± % of the goal"),
            help="Of `bandwidth`: no feedback within so many percent of the goal.",
            kind=int,
            default=round(100 * _SCHEDULE.band),
            least=1,
            most=50,
            unit="%",
            place="schedule.band",
            conversion=PERCENT,
            group=Group.FEEDBACK,
            applies_to=("schedule", ("bandwidth",)),
            column=OptionColumn(
                "schedule_band", "ratio", "Half of the band about the goal without feedback."
            ),
        ),
        Option(
            name="robot_threshold",
            label=_("Robot acts from, % of the goal"),
            help="Percent of the goal.",
            kind=int,
            default=round(100 * DEFAULT_ACTIVATION_THRESHOLD),
            least=1,
            most=200,
            unit="%",
            place="activation_threshold",
            conversion=PERCENT,
            control=ChangeKind.ACTIVATION_THRESHOLD,
            group=Group.ROBOT,
            column=OptionColumn(
                "activation_threshold", "ratio", "Mean performance from which the robot answers."
            ),
        ),
        Option(
            name="robot_answers",
            label=_("Robot answers"),
            help="What the robot's gestures answer.",
            kind=CueRule,
            choices=[
                (CueRule.WINDOWS.value, _("some seconds")),
                (CueRule.STREAKS.value, _("steps in a row")),
                (CueRule.STEPS.value, _("every so many steps")),
            ],
            default=_CUE.rule.value,
            place="cue_timing.rule",
            group=Group.ROBOT,
            column=OptionColumn(
                "robot_rule", "", "What its gestures answer: windows, streaks or steps."
            ),
        ),
        Option(
            name="robot_window",
            label=_("Robot’s window, in seconds"),
            help="Length of a window.",
            kind=float,
            default=_CUE.window_s,
            least=WINDOW_MIN_S,
            most=WINDOW_MAX_S,
            unit="s",
            place="cue_timing.window_s",
            group=Group.ROBOT,
            applies_to=("robot_answers", ("windows",)),
            column=OptionColumn("robot_window", "s", "Length of a window."),
        ),
        Option(
            name="robot_count",
            label=_("Steps that the robot answers"),
            help="Steps of a streak or group.",
            kind=int,
            default=_CUE.count,
            least=1,
            most=COUNT_MAX,
            place="cue_timing.count",
            group=Group.ROBOT,
            applies_to=("robot_answers", ("streaks", "steps")),
            column=OptionColumn(
                "robot_count", "", "Steps of a streak, or of which each last one is answered."
            ),
        ),
        Option(
            name="robot_rest",
            label=_("Robot’s rest, in seconds"),
            help="Least time between two gestures.",
            kind=float,
            default=_CUE.rest_s,
            least=0,
            most=REST_MAX_S,
            unit="s",
            place="cue_timing.rest_s",
            group=Group.ROBOT,
            column=OptionColumn(
                "robot_rest", "s", "Least time between the starts of two gestures."
            ),
        ),
        Option(
            name="device",
            label=_("Device (treadmill, orthosis, cane …)"),
            help="What the patient walks on or with.",
            kind=str,
            default="",
            max_length=MAX_DEVICE_LETTERS,
            place="walking.device",
            group=Group.WALKING,
            is_of_patient=True,
            column=OptionColumn("device", "", "What the patient walked on or with."),
        ),
        Option(
            name="belt_speed",
            label=_("Belt speed, m/s"),
            help="Of the treadmill.",
            kind=float,
            nullable=True,
            least=BELT_M_S[0],
            most=BELT_M_S[1],
            unit="m/s",
            place="walking.belt_speed_m_s",
            group=Group.WALKING,
            is_of_patient=True,
            column=OptionColumn("belt_speed", "m/s", "Speed of the treadmill's belt."),
        ),
        Option(
            name="weight_support",
            label=_("Body-weight support, %"),
            help="Percent of the body's weight.",
            kind=float,
            nullable=True,
            least=SUPPORT_PERCENT[0],
            most=SUPPORT_PERCENT[1],
            unit="%",
            place="walking.weight_support_percent",
            group=Group.WALKING,
            is_of_patient=True,
            column=OptionColumn("weight_support", "%", "Body weight that a harness carried."),
        ),
    )
}


def options_of(*groups: Group) -> list[Option]:
    """Return the options that the set-up shows in some groups."""
    return [option for option in OPTIONS.values() if option.group in groups]


def preset_options() -> list[Option]:
    """Return the options that presets have."""
    return [option for option in OPTIONS.values() if not option.is_of_patient]


def exported_options() -> list[tuple[Option, OptionColumn]]:
    """Return the options that have a column in exports, each with it."""
    return [(option, option.column) for option in OPTIONS.values() if option.column]


def build_parts(values: Mapping[str, Any]) -> dict[str, Any]:
    """Return the parts of a plan, and how the patient walks, as chosen.

    Parameters
    ----------
    values
        By the name of an option, as people give them. Parts of which no option is named are left
        out.

    Raises
    ------
    InvalidSetting
        For values that a part refuses.
    """
    given: dict[str, dict[str, Any]] = defaultdict(dict)
    for name, value in values.items():
        option = OPTIONS[name]
        if not option.place or option.is_derived:
            continue
        other, meant = option.applies_to or ("", ())
        if value is None or (option.nullable and other and values[other] not in meant):
            planned = None
        else:
            planned = option.conversion.to_plan(value)
            planned = option.kind(planned) if issubclass(option.kind, StrEnum) else planned
        part, _between, place = option.place.partition(".")
        given[part][place] = planned
    return {
        part: PARTS[part](**fields) if part in PARTS else fields[""]
        for part, fields in given.items()
    }
