"""The set-up options that say when page and robot answer, and whether the goal follows."""

from __future__ import annotations

from django.utils.translation import gettext_lazy as _

from rehab.sessions.setup.option import (
    PERCENT,
    Group,
    Option,
    OptionColumn,
)
from rehab.training.changes import ChangeKind
from rehab.training.goal_adaptation import AdaptationMode, GoalAdaptation
from rehab.training.robot_cueing import CueTiming
from rehab.training.schedules import INTERVAL_MAX, Schedule, ScheduleKind
from robot.wire.cue_limits import (
    COUNT_MAX,
    DEFAULT_THRESHOLD,
    REST_MAX_S,
    WINDOW_MAX_S,
    WINDOW_MIN_S,
    CueRule,
)

_CUE, _SCHEDULE = CueTiming(), Schedule()

ANSWER_OPTIONS = (
    Option(
        name="goal_follows",
        label=_("The goal"),
        help="Whether the goal stays, is suggested or follows by itself.",
        kind=AdaptationMode,
        choices=[
            (AdaptationMode.OFF.value, _("stays")),
            (AdaptationMode.SUGGEST.value, _("GARRY suggests")),
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
        name="words_vary",
        label=_("Phrases take turns"),
        help="Whether a band's phrases take turns; else its first one is always shown.",
        kind=bool,
        default=True,
        place="words_vary",
        group=Group.FEEDBACK,
        column=OptionColumn("words_vary", "", "true: phrases of a band take turns, by the seed."),
    ),
    Option(
        name="robot_threshold",
        label=_("Robot acts from, % of the goal"),
        help="Percent of the goal.",
        kind=int,
        default=round(100 * DEFAULT_THRESHOLD),
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
        column=OptionColumn("robot_rest", "s", "Least time between the starts of two gestures."),
    ),
)
