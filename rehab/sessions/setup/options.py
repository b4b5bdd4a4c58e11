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

from rehab.sessions.setup.answer_options import ANSWER_OPTIONS
from rehab.sessions.setup.main_options import MAIN_OPTIONS
from rehab.sessions.setup.option import Group, Option, OptionColumn
from rehab.sessions.setup.walking_conditions import WalkingConditions
from rehab.sessions.setup.walking_options import WALKING_OPTIONS
from rehab.training.goal_adaptation import GoalAdaptation
from rehab.training.goals import GoalRule, Target
from rehab.training.robot_cueing import CueTiming
from rehab.training.schedules import Schedule

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

OPTIONS: dict[str, Option] = {
    option.name: option for option in (*MAIN_OPTIONS, *ANSWER_OPTIONS, *WALKING_OPTIONS)
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
