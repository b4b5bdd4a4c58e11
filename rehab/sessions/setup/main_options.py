"""The set-up options with a place of their own on the page: type, goal, source, robot."""

from __future__ import annotations

from typing import Any

from django.utils.text import capfirst
from django.utils.translation import gettext_lazy as _

from rehab.feedback.translation import valence_choices
from rehab.people.models import User
from rehab.sessions.formatting import format_source
from rehab.sessions.setup.cue_gestures import (
    DEFAULT_GESTURE,
    GESTURE_NAMES,
    robot_gesture_choices,
)
from rehab.sessions.setup.option import (
    MINUTES,
    PERCENT,
    Conversion,
    Group,
    Option,
    OptionColumn,
)
from rehab.sessions.setup.sources import LIVE, source_choices
from rehab.training.changes import ChangeKind
from rehab.training.measures import A2
from rehab.training.plans import ROBOT_LEVELS, name_robot_level
from rehab.training.valences import POSITIVE

GOAL_KINDS = ("value", "percent")
# The paper's example of a goal for a whole session (docs/reference/original.md#goal-of-a-session):
# 60 % of the steps, ten minutes.
WANTED_HITS_PERCENT = 60
PLANNED_MINUTES = 10


def _list_sources(_by: User | None) -> list[tuple[str, str]]:
    return [(name, format_source(label)) for name, label in source_choices()]


def _list_gestures(by: User | None) -> list[tuple[str, Any]]:
    return [] if by is None else robot_gesture_choices(by)


MAIN_OPTIONS = (
    Option(
        name="valence",
        api_name="feedback_type",
        label=_("Feedback type"),
        help="The rule set of feedback.",
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
        label=capfirst(_("target hit rate, % of steps")),
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
        choices=_list_sources,
        is_radio=True,
        default=LIVE,
        is_required=True,
    ),
    Option(
        name="robot",
        label=_("Robot"),
        help="How lively it is.",
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
        help=f"Gesture after a window above the threshold: {GESTURE_NAMES}",
        choices=_list_gestures,
        default=DEFAULT_GESTURE,
        is_required=True,
        place="valence.cue.above",
        group=Group.ROBOT,
        is_derived=True,
    ),
    Option(
        name="robot_below",
        label=_("After weak steps"),
        help=f"Gesture after a window below it: {GESTURE_NAMES}",
        choices=_list_gestures,
        default=DEFAULT_GESTURE,
        is_required=True,
        place="valence.cue.below",
        group=Group.ROBOT,
        is_derived=True,
    ),
)
