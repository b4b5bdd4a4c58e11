"""Plans: everything a session is scored with, fixed at its creation and stored beside its log."""

from __future__ import annotations

from dataclasses import asdict, dataclass, field
from enum import StrEnum
from typing import Any

from rehab.training.closeness import CloseSteps
from rehab.training.feedback_bands import Band, bands_from_json
from rehab.training.goal_adaptation import AdaptationMode, GoalAdaptation, check_adaptation_mode
from rehab.training.goals import GoalRule, Target
from rehab.training.measures import InvalidSetting, Measure
from rehab.training.phases import Phase
from rehab.training.phrases import choose_phrase
from rehab.training.robot_cueing import (
    CueTiming,
    check_activation_threshold,
    check_cue_rule,
)
from rehab.training.schedules import Schedule, check_schedule_kind
from rehab.training.steps import Side
from rehab.training.valences import CueGestures, Valence
from robot.marking import gettext_noop
from robot.wire.cue_limits import DEFAULT_THRESHOLD

# How lively the robot is: the share of a gesture's size, by a name that pages translate. The robot
# itself makes half of it gentle (no sounds, half the speed).
ROBOT_LEVELS = {gettext_noop("normal"): 1.0, gettext_noop("gentle"): 0.5, gettext_noop("off"): 0.0}


def check_robot_intensity(intensity: float) -> float:
    """Return the intensity as a float. Raises InvalidSetting for one that is no level."""
    if intensity not in ROBOT_LEVELS.values():
        levels = ", ".join(f"{level} ({value:g})" for level, value in ROBOT_LEVELS.items())
        raise InvalidSetting("A robot's intensity is one of: {levels}.", levels=levels)
    return float(intensity)


class ChartStyle(StrEnum):
    """How the patient's page draws the latest strides."""

    POINTS = "points"
    LINE = "line"


def check_chart_style(style: object) -> ChartStyle:
    """Return the chart style of that name. Raises InvalidSetting, naming the known ones."""
    try:
        return ChartStyle(style)  # type: ignore[arg-type]  # any object may be looked up
    except ValueError:
        raise InvalidSetting(
            "A chart's style is one of: {known}.", known=", ".join(ChartStyle)
        ) from None


def name_robot_level(intensity: float | None) -> str:
    """Return the name of an intensity's level, "" for None."""
    return next((name for name, value in ROBOT_LEVELS.items() if value == intensity), "")


@dataclass(frozen=True, slots=True, kw_only=True)
class PlanSettings:
    """The part of a plan that the PT sets.

    Attributes
    ----------
    goal, target
        What a step should reach, and the target of the whole session.
    activation_threshold, robot_intensity, cue_timing
        Mean performance at which the robot celebrates, the share of its gestures' size, and what
        they answer.
    schedule
        After which steps the patient gets feedback.
    words_vary
        Whether phrases of a band's pool take turns; else its first one is always the one.
    adaptation
        Whether goals follow the patient.
    seed
        What the order of phrases and of the robot's variants follows from; 0 to have one drawn.
    locked
        Whether what defines the condition stays as it was planned: in a study's session.
    heart_rate_limit
        Above it a stride pauses the session [1/min]; None for no limit.
    """

    goal: GoalRule
    target: Target = field(default_factory=Target)
    activation_threshold: float = DEFAULT_THRESHOLD
    robot_intensity: float = 1.0
    cue_timing: CueTiming = field(default_factory=CueTiming)
    schedule: Schedule = field(default_factory=Schedule)
    words_vary: bool = True
    adaptation: GoalAdaptation = field(default_factory=GoalAdaptation)
    seed: int = 0
    locked: bool = False
    heart_rate_limit: int | None = None


@dataclass(frozen=True, slots=True)
class SessionPlan(PlanSettings):
    """What is measured and rewarded, in which phases, and with which settings.

    Attributes
    ----------
    measure, valence, phases
        What is trained, the rule set of feedback, and the session's parts.
    trained_side
        The leg whose steps are scored.
    gestures
        Composed gestures that a cue names, as they are sent to the robot.
    alternatives
        Valences that the session may be changed to, as edited by the clinic until its creation.
    close_steps
        Which steps are too uncertain to count as hit or miss.
    language
        Of the plan's texts.

    Raises
    ------
    InvalidSetting
        For a plan that cannot be walked: no phase, a goal outside the measure's bounds, a goal from
        a baseline that does not come before the first feedback, an automatic goal that would have
        no misses or no hits to go by.
    """

    measure: Measure
    valence: Valence
    phases: tuple[Phase, ...]
    trained_side: Side
    gestures: tuple[dict[str, Any], ...] = ()
    alternatives: tuple[Valence, ...] = ()
    close_steps: CloseSteps = field(default_factory=CloseSteps)
    language: str = "en"

    def __post_init__(self) -> None:
        if not self.phases:
            raise InvalidSetting("A session needs at least one phase.")
        self.goal.resolve(self.measure, None)
        check_activation_threshold(self.activation_threshold)
        check_robot_intensity(self.robot_intensity)
        self.adaptation.check_hit_rate(self.target.hit_rate)
        kinds = [phase.kind for phase in self.phases]
        if self.goal.needs_baseline:
            first_feedback = next((i for i, p in enumerate(self.phases) if p.feedback), len(kinds))
            if "baseline" not in kinds[:first_feedback]:
                raise InvalidSetting(
                    "A goal in percent of baseline needs a baseline phase before the first "
                    "feedback. Put one first, or give the goal as a value."
                )
        for index, phase in enumerate(self.phases):
            if phase.goal_percent is not None and "baseline" not in kinds[:index]:
                raise InvalidSetting(
                    "Phase {name!r} has a goal in percent of the baseline, and no baseline comes "
                    "before it. Put one first, or let the goal stay.",
                    name=phase.name,
                )

    @property
    def has_robot(self) -> bool:
        """Whether a robot takes part: not where it is off and no phase gives it steps."""
        return self.robot_intensity > 0 or any(phase.robot for phase in self.phases)

    def choose_words(self, band: Band, shown: int) -> str:
        """Return what a band says after so many answers in the session."""
        phrases = band.phrases if self.words_vary else band.phrases[:1]
        return choose_phrase(phrases, self.seed, shown)

    def check_phase(self, index: float) -> int:
        """Return the index of a phase as an int. Raises InvalidSetting where there is none."""
        if not 0 <= index < len(self.phases) or index != int(index):
            raise InvalidSetting(
                "This session has no phase {value:g}; its phases are numbered 0 to {last}.",
                value=index,
                last=len(self.phases) - 1,
            )
        return int(index)

    def to_json(self) -> dict[str, Any]:
        """Return the plan as plain JSON data."""
        return asdict(self)

    @classmethod
    def from_json(cls, data: dict[str, Any]) -> SessionPlan:
        """Return the plan that ``to_json`` wrote, also in a version that had fewer fields."""
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
            cue_timing=_read_cue_timing(data.get("cue_timing", {})),
            schedule=_read_schedule(data.get("schedule", {})),
            adaptation=_read_adaptation(data.get("adaptation")),
            close_steps=CloseSteps(**data.get("close_steps", {})),
            locked=data.get("locked", False),
            language=data.get("language", "en"),
            words_vary=data.get("words_vary", False),
            seed=data.get("seed", 0),
            heart_rate_limit=data.get("heart_rate_limit"),
        )


def _read_cue_timing(data: dict[str, Any]) -> CueTiming:
    return CueTiming(**data | {"rule": check_cue_rule(data["rule"])} if data else {})


def _read_schedule(data: dict[str, Any]) -> Schedule:
    return Schedule(**data | {"kind": check_schedule_kind(data["kind"])} if data else {})


def _read_adaptation(data: dict[str, Any] | None) -> GoalAdaptation:
    """Return how goals follow; off for a plan from before there was a choice."""
    if data is None:
        return GoalAdaptation(mode=AdaptationMode.OFF)
    return GoalAdaptation(**data | {"mode": check_adaptation_mode(data["mode"])})


def _read_valence(data: dict[str, Any]) -> Valence:
    parts = {"bands": bands_from_json(data["bands"]), "cue": CueGestures(**data["cue"])}
    return Valence(**data | parts)
