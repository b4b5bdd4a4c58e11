"""Participants with what their visits gave, sorted by arms."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from enum import StrEnum
from typing import Any

import numpy as np

from rehab.studies.analysis.clinical_outcomes import is_of_test
from rehab.studies.analysis.curves import Curve, Point, average, curve_of
from rehab.studies.analysis.design_matrix import MIN_PARTICIPANTS, Observation
from rehab.studies.analysis.outcomes import compute_outcomes
from rehab.studies.analysis.phase_figures import channel_changes, describe_phases
from rehab.studies.analysis.walk_figures import History
from rehab.studies.analysis.walks import Walk

CHANNEL = "channel:"  # begins the slug of a further channel's change: never registered


class Attendance(StrEnum):
    """What became of a planned visit."""

    FINISHED = "finished"
    UNFINISHED = "unfinished"  # ended early: it counts as far as it was walked
    EXCLUDED = "excluded"  # by a correction, with its reason
    MISSED = "missed"


@dataclass(frozen=True, slots=True)
class ParticipantVisit:
    """A planned visit: in which arm, and what it gave.

    Attributes
    ----------
    number, arm, period
        Of the visit, from 1; the arm's code; of a crossover, from 0.
    is_due
        Whether its day is past, or it was walked.
    attendance
        What became of it.
    outcomes
        By slug; where it was not walked or does not count, of clinical tests alone.
    phases, planned
        Figures of each phase that was walked, as `describe_phases` returns them; how many phases
        the session had.
    """

    number: int
    arm: str
    is_due: bool = True
    period: int = 0
    attendance: Attendance = Attendance.MISSED
    outcomes: dict[str, float] = field(default_factory=dict)
    phases: tuple[dict[str, Any], ...] = ()
    planned: int = 0

    @property
    def is_walked(self) -> bool:
        """Whether it gave anything beside clinical tests."""
        return not all(map(is_of_test, self.outcomes))


@dataclass(frozen=True, slots=True)
class Participant:
    """One participant.

    Attributes
    ----------
    code, visits
        By which results name the participant; the planned visits in their order.
    has_left, is_analyzed
        Whether the participant withdrew; whether the sessions count in the results.
    curves
        A curve for each arm.
    baseline, measure
        Mean of the first session's baseline, None of too few valid strides; what it is a mean of.
    levels
        Of the factors that the allocation balances.
    clinical_baselines
        The first baselines of clinical tests, by the outcome's slug.
    """

    code: str
    visits: tuple[ParticipantVisit, ...]
    has_left: bool = False
    is_analyzed: bool = True
    curves: dict[str, Curve] = field(default_factory=dict)
    baseline: float | None = None
    measure: str = ""
    levels: tuple[str, ...] = ()
    clinical_baselines: Mapping[str, float] = field(default_factory=dict)

    @property
    def arms(self) -> tuple[str, ...]:
        """The arms that were to be walked, in their order."""
        return tuple(dict.fromkeys(visit.arm for visit in self.visits))

    def outcome(self, slug: str, arm: str) -> float | None:
        """Return the mean of an outcome over the visits in an arm; None where no one has it."""
        visits = self.visits if self.is_analyzed else ()
        found = [v.outcomes[slug] for v in visits if v.arm == arm and slug in v.outcomes]
        return sum(found) / len(found) if found else None

    def observe(self, slug: str) -> Iterator[Observation]:
        """Yield an outcome of each visit that was due, also where it is missing."""
        baseline = self.clinical_baselines.get(slug) if is_of_test(slug) else self.baseline
        for visit in self.visits if self.is_analyzed else ():
            if visit.is_due:
                value = visit.outcomes.get(slug)
                of_person = baseline, visit.period, self.levels
                yield Observation(self.code, visit.arm, visit.number, value, *of_person)


@dataclass(frozen=True, slots=True)
class AnalyzedSession:
    """A session that counts: its strides, its metrics, what was measured, how it ended."""

    walk: Walk
    metrics: dict[str, float]
    measure: str = ""
    is_finished: bool = True


def make_participant(
    code: str,
    planned: Sequence[tuple[ParticipantVisit, AnalyzedSession | None]],
    *,
    has_left: bool = False,
    is_analyzed: bool = True,
    levels: Sequence[str] = (),
    clinical_baselines: Mapping[str, float] | None = None,
) -> Participant:
    """Return a participant from the planned visits and what was walked of them.

    Parameters
    ----------
    code
        By which results name the participant.
    planned
        The visits in their order with the outcomes of clinical tests, each with its session; None
        where none counts.
    has_left, is_analyzed
        Whether the participant withdrew; whether the sessions count in the results.
    levels
        Of the factors that the allocation balances.
    clinical_baselines
        Of clinical tests, by the outcome's slug.
    """
    visits: list[ParticipantVisit] = []
    walks: dict[str, list[Walk | None]] = {}
    first: AnalyzedSession | None = None
    before: Walk | None = None
    for visit, walked in planned:
        walks.setdefault(visit.arm, []).append(None if walked is None else walked.walk)
        if walked is None:
            visits.append(visit)
            continue
        first = first or walked
        channels = channel_changes(walked.walk)
        history = History(before, first.walk.baseline)
        outcomes = visit.outcomes | compute_outcomes(walked.walk, history, walked.metrics)
        outcomes |= {f"{CHANNEL}{name}": value for name, value in channels.items()}
        visits.append(
            replace(
                visit,
                is_due=True,
                attendance=Attendance.FINISHED if walked.is_finished else Attendance.UNFINISHED,
                outcomes=outcomes,
                phases=tuple(describe_phases(walked.walk)),
                planned=len(walked.walk.phases),
            )
        )
        before = walked.walk
    curves = {arm: curve_of(of_arm) for arm, of_arm in walks.items()}
    baseline, measure = (first.walk.baseline, first.measure) if first else (None, "")
    about = curves, baseline, measure, tuple(levels), clinical_baselines or {}
    return Participant(code, tuple(visits), has_left, is_analyzed, *about)


def by_arm(
    participants: Sequence[Participant], arms: Sequence[str], slug: str
) -> dict[str, dict[str, float]]:
    """Return an outcome of those who have it, by arm and participant's code."""
    return {
        arm: {
            one.code: value for one in participants if (value := one.outcome(slug, arm)) is not None
        }
        for arm in arms
    }


def distinct(participants: Sequence[Participant], slugs: Sequence[str]) -> list[str]:
    """Return the outcomes that are no earlier one in another unit or from another origin.

    Where the goal follows the baseline, the mean of value / goal is the improvement over it.
    """
    shapes: dict[object, str] = {}
    for slug in slugs:
        visits = [(one.code, visit) for one in participants for visit in one.visits]
        have_it = [(code, visit) for code, visit in visits if slug in visit.outcomes]
        values = np.array([visit.outcomes[slug] for _code, visit in have_it])
        shape: object = slug
        if len(values) >= MIN_PARTICIPANTS and values.std() > 0:
            places = tuple((code, visit.number) for code, visit in have_it)
            shape = places, tuple(((values - values.mean()) / values.std()).round(6))
        shapes.setdefault(shape, slug)
    return list(shapes.values())


def curves_by_arm(
    participants: Sequence[Participant], arms: Sequence[str]
) -> dict[str, list[Point]]:
    """Return the mean curve of each arm."""
    return {
        arm: average(
            [one.curves[arm] for one in participants if one.is_analyzed and one.curves.get(arm)]
        )
        for arm in arms
    }


@dataclass(frozen=True, slots=True)
class ArmFlow:
    """An arm's column of the flow of participants (CONSORT 2025, item 22a).

    Who was allocated began, never began, or had the data removed; ``left``: of those who began.
    """

    arm: str
    allocated: int
    never_began: int
    began: int
    completed: int
    left: int
    removed: int
    analyzed: int
    visits_planned: int
    visits_walked: int
    visits_unfinished: int
    visits_excluded: int


def flow(
    participants: Sequence[Participant], arms: Sequence[str], primary: str
) -> tuple[ArmFlow, ...]:
    """Return how many were allocated to each arm, and what became of them.

    ``analyzed``: those who have the primary outcome. Visits: those that are due.
    """
    return tuple(_flow_of(participants, arm, primary) for arm in arms)


def _flow_of(participants: Sequence[Participant], arm: str, primary: str) -> ArmFlow:
    mine = [one for one in participants if arm in one.arms]
    visits = [[visit for visit in one.visits if visit.arm == arm] for one in mine]
    became = Counter(visit.attendance for of_one in visits for visit in of_one)
    began = [any(visit.is_walked for visit in of_one) for of_one in visits]
    removed = sum(not one.is_analyzed for one in mine)
    return ArmFlow(
        arm,
        allocated=len(mine),
        never_began=len(mine) - sum(began) - removed,
        began=sum(began),
        completed=sum(
            all(visit.attendance is Attendance.FINISHED for visit in of_one) for of_one in visits
        ),
        left=sum(one.has_left and walked for one, walked in zip(mine, began, strict=True)),
        removed=removed,
        analyzed=sum(one.outcome(primary, arm) is not None for one in mine),
        visits_planned=sum(visit.is_due for of_one in visits for visit in of_one),
        visits_walked=sum(visit.is_walked for of_one in visits for visit in of_one),
        visits_unfinished=became[Attendance.UNFINISHED],
        visits_excluded=became[Attendance.EXCLUDED],
    )
