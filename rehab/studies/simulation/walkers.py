"""Simulated participants: synthetic walkers who differ, and on whom each arm has a known effect."""

from __future__ import annotations

import random
from collections.abc import Iterator
from dataclasses import dataclass, replace

from rehab.sources.synthetic import GOOD, SyntheticWalker
from rehab.training.fold import SessionFold
from rehab.training.measures import InvalidSetting
from rehab.training.phases import Phase
from rehab.training.steps import Measurement, Side
from robot.marking import gettext_noop

STRIDES_MAX = 20_000  # of one session: more than three hours
ENDLESS = gettext_noop(
    "This protocol has a phase without an end, and simulated people would walk it for ever: give "
    "each phase strides or seconds."
)


@dataclass(frozen=True, slots=True)
class Population:
    """How simulated participants differ, and how much of an effect they retain.

    Attributes
    ----------
    sd_percent
        Standard deviation between participants of what training adds [% of the baseline], besides
        what strides scatter. No study of feedback of push-off in stroke has reported it; the five
        recorded sessions of two people lie 5 to 25 % apart.
    retained
        Share of effect and difference that remains without feedback (catch, washout, retention).
    dropout
        Probability that a participant leaves before a visit, for each visit (ratio).

    Raises
    ------
    InvalidSetting
        For values out of bounds.
    """

    sd_percent: float = 10.0
    retained: float = 0.25
    dropout: float = 0.0

    def __post_init__(self) -> None:
        if not 0 <= self.sd_percent <= 100:
            raise InvalidSetting("Participants differ by 0 to 100 % of their baseline.")
        if not 0 <= self.retained <= 1:
            raise InvalidSetting("What is kept of an effect is a share from 0 to 1.")
        if not 0 <= self.dropout < 1:
            raise InvalidSetting("The share that leaves before a visit is 0 or more, and below 1.")


class SimulatedParticipant(SyntheticWalker):
    """A synthetic walker on whom an arm has exactly the given effect.

    It learns, tires and answers goal, gain and hits as any other; what the arm adds comes on top,
    so that the true difference between arms is known.
    """

    def __init__(
        self,
        seed: int,
        side: Side,
        *,
        baseline_w_kg: float,
        is_first: bool,
        percent: float,
        retained: float,
    ) -> None:
        """Make a participant for one visit. ``percent``: what training adds [% of baseline]."""
        # Who has trained before searches no more: retention between sessions was about 100 %
        # (docs/reference/gait.md#dynamics).
        search = GOOD.exploration_strides if is_first else 0
        profile = replace(GOOD, baseline_w_kg=baseline_w_kg, exploration_strides=search)
        super().__init__(profile, seed, side)
        self._added_w_kg = baseline_w_kg * percent / 100
        self._retained = retained

    def next_stride(self, phase: Phase) -> Measurement:
        """Return the next stride, walked in a phase."""
        stride = super().next_stride(phase)
        if stride.value is None or phase.kind == "baseline":
            return stride
        added = self._added_w_kg if phase.feedback else self._added_w_kg * self._retained
        return replace(stride, value=round(max(0.0, stride.value + added), 4))


@dataclass(frozen=True, slots=True)
class Person:
    """What one simulated participant is, whatever the arm. ``leaves_before``: visit, 0 for none."""

    seed: str
    baseline_w_kg: float
    response_percent: float
    leaves_before: int

    def at_visit(self, visit: int, effect_percent: float, retained: float) -> SimulatedParticipant:
        """Return the walker of one visit.

        Parameters
        ----------
        visit
            Number of the visit, from 1.
        effect_percent
            What the arm adds to training [% of the baseline].
        retained
            Share of what training adds that remains without feedback (ratio).
        """
        draw = random.Random(f"{self.seed}/{visit}")  # noqa: S311 (chance for walking)
        return SimulatedParticipant(
            draw.getrandbits(48),
            Side.LEFT,
            baseline_w_kg=self.baseline_w_kg,
            is_first=visit == 1,
            percent=effect_percent + self.response_percent,
            retained=retained,
        )


def draw_person(seed: int, number: int, population: Population, visits: int) -> Person:
    """Return a participant, drawn so that the same arguments always give the same person.

    Parameters
    ----------
    seed, number
        Of the study, and of the participant in it, from 1.
    population
        How people differ.
    visits
        How many are planned, each of which the person may leave before.
    """
    name = f"{seed}/{number}"
    draw = random.Random(name)  # noqa: S311 (chance for walking)
    baseline_w_kg = round(2.0 + 2.5 * draw.random(), 3)  # HEBB_03 has 3.9, HEBB_91 2.2
    response = population.sd_percent * (sum(draw.random() for _ in range(12)) - 6)
    leaves = [draw.random() < population.dropout for _ in range(visits)]
    return Person(name, baseline_w_kg, response, leaves.index(True) + 1 if any(leaves) else 0)


def walk_through(walker: SyntheticWalker, fold: SessionFold) -> Iterator[Measurement]:
    """Yield strides, each made for the session's phase and goal, until the plan is completed.

    Parameters
    ----------
    walker
        Who walks.
    fold
        The session, to which the caller adds each stride before asking for the next.

    Raises
    ------
    InvalidSetting
        For a plan that has not ended after ``STRIDES_MAX`` strides.
    """
    for _ in range(STRIDES_MAX):
        if fold.completed:
            return
        walker.goal_w_kg = fold.goal
        yield walker.next_stride(fold.phase)
    raise InvalidSetting(ENDLESS)
