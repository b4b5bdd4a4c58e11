"""Everything a session is scored with, fixed when it is created and kept beside its log."""

from __future__ import annotations

from dataclasses import asdict, dataclass, field
from enum import StrEnum
from typing import Any

from rehab.training.goals import GoalRule, Target
from rehab.training.measures import InvalidSetting, Measure
from rehab.training.phases import Phase
from rehab.training.steps import Side
from rehab.training.valences import CueGestures, Valence, bands_from_json

# The paper's default (P 3.4.1): the robot answers windows of at least 90 % of the goal.
DEFAULT_ACTIVATION_THRESHOLD = 0.90

# How the robot may answer: the share of a gesture's size. What makes half of it gentle (no sounds,
# half the speed) is the robot's own rule.
ROBOT_LEVELS = {"normal": 1.0, "gentle": 0.5, "off": 0.0}


def check_activation_threshold(threshold: float) -> float:
    """Give the threshold back as a number. Raises InvalidSetting outside (0, 2]."""
    if not 0 < threshold <= 2:
        raise InvalidSetting("The activation threshold lies above 0 and up to 2 (0.9 for 90 %).")
    return float(threshold)


def check_robot_intensity(intensity: float) -> float:
    """Give the intensity back as a number. Raises InvalidSetting for one that is no level."""
    if intensity not in ROBOT_LEVELS.values():
        levels = ", ".join(f"{level} ({value:g})" for level, value in ROBOT_LEVELS.items())
        raise InvalidSetting("A robot's intensity is one of: {levels}.", levels=levels)
    return float(intensity)


class ChartStyle(StrEnum):
    """How the patient's page draws the latest strides."""

    POINTS = "points"
    LINE = "line"


def name_robot_level(intensity: float | None) -> str:
    """Give the level's name; empty for none."""
    return next((name for name, value in ROBOT_LEVELS.items() if value == intensity), "")


@dataclass(frozen=True, slots=True)
class SessionPlan:
    """What is measured, how it is paid, in which phases, towards which goal, how a robot answers.

    ``alternatives`` are the valences that it may be changed to on its way, as they are then.
    ``gestures`` are those that somebody composed and a cue names, as they travel to the robot.
    ``language`` is the one that its words are in.
    Raises InvalidSetting for a plan that could not be walked: no phase, a goal outside the
    measure's bounds, a goal from a baseline that does not come before the first feedback.
    """

    measure: Measure
    valence: Valence
    phases: tuple[Phase, ...]
    trained_side: Side
    goal: GoalRule
    target: Target = field(default_factory=Target)
    activation_threshold: float = DEFAULT_ACTIVATION_THRESHOLD
    robot_intensity: float = 1.0
    gestures: tuple[dict[str, Any], ...] = ()
    alternatives: tuple[Valence, ...] = ()
    language: str = "en"

    def __post_init__(self) -> None:
        if not self.phases:
            raise InvalidSetting("A session needs at least one phase.")
        self.goal.resolve(self.measure, None)
        check_activation_threshold(self.activation_threshold)
        check_robot_intensity(self.robot_intensity)
        if self.goal.needs_baseline:
            kinds = [phase.kind for phase in self.phases]
            first_feedback = next((i for i, p in enumerate(self.phases) if p.feedback), len(kinds))
            if "baseline" not in kinds[:first_feedback]:
                raise InvalidSetting(
                    "A goal in percent of baseline needs a baseline phase before the first "
                    "feedback. Put one first, or give the goal as a value."
                )

    def to_json(self) -> dict[str, Any]:
        """Give the plan as plain JSON data."""
        return asdict(self)

    @classmethod
    def from_json(cls, data: dict[str, Any]) -> SessionPlan:
        """Rebuild a plan from ``to_json``'s data, also of a plan that knew less than today's."""
        return cls(
            measure=Measure(**data["measure"]),
            valence=_read_valence(data["valence"]),
            phases=tuple(Phase(**phase) for phase in data["phases"]),
            trained_side=Side(data["trained_side"]),
            goal=GoalRule(**data["goal"]),
            target=Target(**data["target"]),
            activation_threshold=data["activation_threshold"],
            robot_intensity=data["robot_intensity"],
            gestures=tuple(data["gestures"]),
            alternatives=tuple(_read_valence(one) for one in data.get("alternatives", ())),
            language=data.get("language", "en"),
        )


def _read_valence(data: dict[str, Any]) -> Valence:
    parts = {"bands": bands_from_json(data["bands"]), "cue": CueGestures(**data["cue"])}
    return Valence(**data | parts)
