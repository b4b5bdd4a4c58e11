"""When page and robot answer, and whether the goal follows: what set-ups and presets choose."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from django.utils.translation import gettext_lazy as _

from rehab.training.adaptation import AdaptationMode, GoalAdaptation
from rehab.training.cueing import DEFAULT_ACTIVATION_THRESHOLD, CueRule, CueTiming
from rehab.training.plans import SessionPlan
from rehab.training.schedules import Schedule, ScheduleKind

CUE_RULES = [
    (CueRule.WINDOWS.value, _("some seconds")),
    (CueRule.STREAKS.value, _("steps in a row")),
    (CueRule.STEPS.value, _("every so many steps")),
]
SCHEDULES = [
    (ScheduleKind.EVERY.value, _("after every step, or every so many")),
    (ScheduleKind.BANDWIDTH.value, _("only outside of a band about the goal")),
    (ScheduleKind.FADED.value, _("more and more rarely")),
    (ScheduleKind.SUMMARY.value, _("as a summary of so many steps")),
]
ADAPTATIONS = [
    (AdaptationMode.OFF.value, _("stays")),
    (AdaptationMode.SUGGEST.value, _("is suggested")),
    (AdaptationMode.AUTOMATIC.value, _("follows by itself")),
]
_USUAL, _EVERY, _MODE = CueTiming(), Schedule(), GoalAdaptation().mode
# What is offered first; a field that is left out of an API call has these values too.
USUAL_ANSWERS: dict[str, Any] = {
    "robot_threshold": round(100 * DEFAULT_ACTIVATION_THRESHOLD),
    "robot_answers": _USUAL.rule.value,
    "robot_window": _USUAL.window_s,
    "robot_count": _USUAL.count,
    "robot_rest": _USUAL.rest_s,
    "schedule": _EVERY.kind.value,
    "schedule_steps": _EVERY.interval,
    "schedule_band": round(100 * _EVERY.band),
    "goal_follows": _MODE.value,
    "goal_asks": False,
}


def read_cue_timing(answers: Mapping[str, Any]) -> CueTiming:
    """Return when a robot decides. Raises InvalidSetting."""
    return CueTiming(
        rule=CueRule(answers["robot_answers"]),
        window_s=answers["robot_window"],
        count=answers["robot_count"],
        rest_s=answers["robot_rest"],
    )


def read_schedule(answers: Mapping[str, Any]) -> Schedule:
    """Return the feedback schedule. Raises InvalidSetting."""
    return Schedule(
        kind=ScheduleKind(answers["schedule"]),
        interval=answers["schedule_steps"],
        band=answers["schedule_band"] / 100,
    )


def read_adaptation(answers: Mapping[str, Any]) -> GoalAdaptation:
    """Return whether the goal follows."""
    return GoalAdaptation(mode=AdaptationMode(answers["goal_follows"]))


def answers_of(plan: SessionPlan, threshold: float, mode: str) -> dict[str, Any]:
    """Return what a session's set-up chose, with what was changed of it on the way.

    ``threshold``, ``mode``: those in force at the session's end.
    """
    timing, schedule = plan.cue_timing, plan.schedule
    return {
        "robot_threshold": round(100 * threshold),
        "robot_answers": timing.rule.value,
        "robot_window": timing.window_s,
        "robot_count": timing.count,
        "robot_rest": timing.rest_s,
        "schedule": schedule.kind.value,
        "schedule_steps": schedule.interval,
        "schedule_band": round(100 * schedule.band),
        "goal_follows": mode,
        "goal_asks": plan.goal.asks,
    }
