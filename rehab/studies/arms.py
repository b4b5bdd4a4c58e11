"""Arms: the conditions that a study compares."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass, field, replace

from rehab.training.measures import WORN_CHANNELS, InvalidSetting, check_gain
from rehab.training.phases import Phase
from rehab.training.plans import check_robot_intensity
from rehab.training.schedules import Schedule
from rehab.training.valences import find_valence

MAX_ARMS = 8
CODE = re.compile(r"[A-Z0-9]{1,4}")
# Until then a stroke counts as recent, and negative feedback is warned of
# (docs/reference/gait.md#feedback-and-time-since-stroke).
EARLY_MONTHS = 6


@dataclass(frozen=True, slots=True)
class Condition:
    """What an arm does to a session, apart from its name.

    Attributes
    ----------
    valence
        Slug of the feedback type.
    gain
        What the shown value of phases with feedback is multiplied with, besides their own gain.
    robot_intensity
        One of `ROBOT_LEVELS`.
    measure, protocol
        Keys of what is trained and of the phases.
    schedule
        After which steps the patient gets feedback.

    Raises
    ------
    InvalidSetting
        For what no session could be created from.
    """

    valence: str
    gain: float
    robot_intensity: float
    measure: int
    protocol: int
    schedule: Schedule = field(default_factory=Schedule)

    def __post_init__(self) -> None:
        find_valence(self.valence)
        check_gain(self.gain)
        check_robot_intensity(self.robot_intensity)

    def apply_to(self, phases: Sequence[Phase]) -> tuple[Phase, ...]:
        """Return a protocol's phases with the arm's gain where feedback is given.

        Raises InvalidSetting where the product is out of bounds.
        """
        return tuple(
            replace(phase, gain=phase.gain * self.gain) if phase.feedback else phase
            for phase in phases
        )


@dataclass(frozen=True, slots=True)
class ArmRule:
    """An arm: its code (which reveals no condition), name, part of the ratio, condition.

    Raises
    ------
    InvalidSetting
        For a code that could not stand in a list.
    """

    code: str
    name: str
    weight: int
    condition: Condition

    def __post_init__(self) -> None:
        if not CODE.fullmatch(self.code):
            raise InvalidSetting(
                "“{code}” is no arm's code: use 1 to 4 capital letters or digits, such as A.",
                code=self.code,
            )


def check_arms(arms: Sequence[ArmRule], *, crossover: bool) -> None:
    """Raise InvalidSetting for arms that a study could not compare.

    Parameters
    ----------
    arms
        2 to ``MAX_ARMS`` arms, of different codes and conditions.
    crossover
        Whether each participant walks every arm, so that all weights have to be 1.
    """
    if not 2 <= len(arms) <= MAX_ARMS:
        raise InvalidSetting("A study compares 2 to {most} arms.", most=MAX_ARMS)
    conditions: dict[Condition, ArmRule] = {}
    codes: set[str] = set()
    for arm in arms:
        other = conditions.setdefault(arm.condition, arm)
        if other is not arm:
            raise InvalidSetting(
                "Arms {first} and {second} do the same. Change the feedback type, its schedule, "
                "gain, robot, measure or protocol of one, or remove it.",
                first=other.code,
                second=arm.code,
            )
        if arm.code in codes:
            raise InvalidSetting("Two arms have the code {code}. Change one.", code=arm.code)
        codes.add(arm.code)
        if crossover and arm.weight != 1:
            raise InvalidSetting("In a crossover everybody walks every arm: leave all ratios at 1.")


def check_channels(channels: Sequence[str]) -> None:
    """Raise InvalidSetting where a worn sensor's measure would be pooled with any other one."""
    if len(set(channels)) > 1 and not WORN_CHANNELS.isdisjoint(channels):
        raise InvalidSetting(
            "What a worn sensor measures cannot be compared with anything else. Choose the same "
            "measure for all arms."
        )
