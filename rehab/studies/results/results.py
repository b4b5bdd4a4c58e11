"""A study's results, and who may look at them when."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass
from datetime import date, datetime
from functools import cached_property
from hashlib import sha256
from typing import Any

from django.utils.translation import gettext

from rehab.people.models import User
from rehab.people.roles import Role
from rehab.sessions.formatting import clinic_time
from rehab.studies.analysis.curves import Point
from rehab.studies.analysis.outcomes import OUTCOMES
from rehab.studies.analysis.participants import (
    CHANNEL,
    ArmFlow,
    OutcomeResult,
    Participant,
    ParticipantVisit,
    flow,
)
from rehab.studies.models import Study, StudyMark, StudyState, has_mark
from rehab.studies.participants import StudyEvent
from rehab.studies.registration.lifecycle import note
from rehab.studies.registration.outcome_changes import (
    OutcomeChange,
    RegisteredOutcome,
    outcome_changes,
    registered_outcomes,
)
from rehab.studies.registration.sealing import unseal
from rehab.studies.results.conduct import ConductRow, Occurrence, count, read_occurrences, unwalked
from rehab.studies.results.reading import Analysis, analyze
from rehab.studies.screening import Assessed, count_assessed

# Of these the feedback type decides: who sees them of a group knows its arm.
TELL_THE_TYPE = frozenset({"score", "points_per_100_steps"})


def may_look(study: Study, user: User) -> bool:
    """Return whether an account may see a study's results now.

    Of a closed study all who see studies may; before that only who has the mark for interim looks.
    """
    if study.state == StudyState.CLOSED:
        return user.role in {Role.LEAD, Role.PT, Role.RESEARCHER}
    return study.state == StudyState.RUNNING and has_mark(study, user, StudyMark.Task.INTERIM)


def note_look(study: Study, user: User, now: datetime) -> None:
    """Record an interim look, once a day and person, among the study's events."""
    if study.state == StudyState.CLOSED:
        return
    today = clinic_time(now, study.clinic).date()
    looks = StudyEvent.everywhere.filter(study=study, kind=StudyEvent.Kind.LOOKED, by=user)
    last = looks.order_by("-at").first()
    if last is None or clinic_time(last.at, study.clinic).date() != today:
        note(study, StudyEvent.Kind.LOOKED, user, now)


@dataclass(frozen=True)
class Results:
    """What a study found, as far as it was walked.

    Before the study is closed, aggregates alone, and none that tells which group is which arm: no
    outcome that the feedback type decides, no exploratory one, nothing of fewer than three people.

    Attributes
    ----------
    study, analysis
        The study, and what was computed of everybody who was ever taken in.
    arms
        The arms' codes with the labels that are shown, in the order in which they are shown.
    outcomes, changes
        The registered outcomes, the first primary one first; every change of them.
    occurrences, assessed
        Harms and deviations; the numbers of the screening log.
    """

    study: Study
    analysis: Analysis
    arms: dict[str, str]
    outcomes: tuple[RegisteredOutcome, ...]
    changes: tuple[OutcomeChange, ...]
    occurrences: tuple[Occurrence, ...]
    assessed: Assessed

    @property
    def participants(self) -> tuple[Participant, ...]:
        """Everybody who was ever taken in."""
        return self.analysis.participants

    @property
    def is_interim(self) -> bool:
        """Whether the study is not closed."""
        return self.study.state != StudyState.CLOSED

    @property
    def primary(self) -> str:
        """Slug of the primary outcome that was registered first."""
        return self.outcomes[0].slug

    @cached_property
    def registered(self) -> dict[str, RegisteredOutcome]:
        """The registered outcomes by their slugs, the primary one first."""
        hidden = TELL_THE_TYPE if self.is_interim else frozenset()
        known = (one for one in self.outcomes if one.slug in OUTCOMES)
        return {one.slug: one for one in known if one.slug not in hidden}

    @cached_property
    def exploratory(self) -> tuple[str, ...]:
        """Slugs of all other outcomes that anybody has."""
        if self.is_interim:
            return ()
        found = {slug for one in self.participants for v in one.visits for slug in v.outcomes}
        rest = [slug for slug in OUTCOMES if slug in found and slug not in self.registered]
        return (*rest, *sorted(slug for slug in found if slug.startswith(CHANNEL)))

    def find(self, slug: str) -> OutcomeResult:
        """Return what was found of an outcome."""
        found = self.analysis.find(slug)
        return found.without_few() if self.is_interim else found

    @property
    def curves(self) -> dict[str, list[Point]]:
        """The mean curve of each arm, by its code."""
        return self.analysis.curves

    @cached_property
    def conduct(self) -> tuple[ConductRow, ...]:
        """How often each harm and deviation happened, by arm; before the end harms alone."""
        rows = count(self.occurrences, self.arms)
        return tuple(row for row in rows if row.kind == "harm" or not self.is_interim)

    @cached_property
    def flow(self) -> tuple[ArmFlow, ...]:
        """How many were allocated to each arm, and what became of them."""
        return flow(self.participants, list(self.arms), self.primary)


def label_arms(study: Study) -> dict[str, str]:
    """Return the arms' codes with their labels: names once the study is closed.

    Before, groups are numbered in an order that the sealed seed draws: whoever looks early sees
    that groups differ, not which one is which.
    """
    arms = list(study.arms.all())
    if study.state == StudyState.CLOSED:
        return {arm.code: str(arm) for arm in arms}
    seed = unseal(study.sealed).seed
    arms.sort(key=lambda arm: sha256(f"{seed}/{arm.code}".encode()).digest())
    return {
        arm.code: gettext("Group %(number)d") % {"number": number}
        for number, arm in enumerate(arms, start=1)
    }


def read_results(study: Study, now: datetime) -> Results:
    """Return a study's results. ``now`` says which visits are due."""
    is_closed = study.state == StudyState.CLOSED  # then whatever was planned was due
    until = date.max if is_closed else clinic_time(now, study.clinic).date()
    arms = label_arms(study)
    analysis = analyze(study, tuple(arms), until)
    return Results(
        study,
        analysis,
        arms,
        registered_outcomes(study),
        outcome_changes(study),
        (*read_occurrences(study), *unwalked(analysis.participants)),
        count_assessed(study),
    )


def _visits(results: Results) -> Iterator[tuple[ParticipantVisit, dict[str, Any]]]:
    """Yield the visits of those who are analyzed, each with the columns that say whose it is."""
    for one in results.participants:
        for visit in one.visits if one.is_analyzed else ():
            group = results.arms[visit.arm]
            place = {"participant": one.code, "group": group, "visit": visit.number}
            yield visit, place | {"attendance": visit.attendance.value}


def outcome_rows(results: Results) -> Iterator[dict[str, Any]]:
    """Yield one row for each participant, visit and outcome: missing ones are empty."""
    for visit, whose in _visits(results):
        for slug in (*results.registered, *results.exploratory):
            about = {"outcome": slug, **_status(results, slug)}
            yield whose | about | {"value": visit.outcomes.get(slug)}


def _status(results: Results, slug: str) -> dict[str, Any]:
    """Return the columns that say as what an outcome was registered, and in which versions."""
    one = results.registered.get(slug)
    return {
        "status": "exploratory" if one is None else one.status,
        "since_version": one and one.since,
        "dropped_in_version": one and one.dropped_in,
    }


def phase_rows(results: Results) -> Iterator[dict[str, Any]]:
    """Yield one row for each participant, visit and phase."""
    for visit, whose in _visits(results):
        yield from (whose | phase for phase in visit.phases)


def difference_rows(results: Results) -> Iterator[dict[str, Any]]:
    """Yield one row for each outcome and pair of groups."""
    for slug in (*results.registered, *results.exploratory):
        for found in results.find(slug).differences:
            yield {
                "outcome": slug,
                **_status(results, slug),
                "group": results.arms[found.group],
                "reference": results.arms[found.reference],
                "participants": found.participants[0],
                "participants_reference": found.participants[1],
                "paired": found.paired,
                "difference": found.difference.estimate,
                "low_95": found.difference.low,
                "high_95": found.difference.high,
                "hedges_g": found.effect and found.effect.estimate,
                "g_low_95": found.effect and found.effect.low,
                "g_high_95": found.effect and found.effect.high,
            }


def curve_rows(results: Results) -> Iterator[dict[str, Any]]:
    """Yield one row for each point of each group's curve, in percent of the baseline."""
    for arm, points in results.curves.items():
        for point in points:
            yield {
                "group": results.arms[arm],
                "visit": point.place.visit + 1,
                "phase": point.place.phase + 1,
                "block_of_10": point.place.bin + 1,
                "participants": point.participants,
                "percent_of_baseline": point.mean,
                "low_95": point.low,
                "high_95": point.high,
            }


def flow_rows(results: Results) -> Sequence[dict[str, Any]]:
    """Return one row for each group of the flow of participants."""
    rows = [asdict(one) | {"primary_outcome": results.primary} for one in results.flow]
    return [{"group": results.arms[row.pop("arm")]} | row for row in rows]


def screening_rows(results: Results) -> Iterator[dict[str, Any]]:
    """Yield one row for each number of the screening log, and for each criterion not met."""
    assessed = results.assessed
    for name in ("people", "not_eligible", "declined"):
        yield {"what": name, "criterion": "", "people": getattr(assessed, name)}
    for criterion, people in assessed.reasons.most_common():
        yield {"what": "criterion not met", "criterion": criterion, "people": people}


def change_rows(results: Results) -> Iterator[dict[str, Any]]:
    """Yield one row for each version that changed outcomes."""
    for one in results.changes:
        row = asdict(one)
        yield row | {name: " ".join(row[name]) for name in ("added", "removed")}


def conduct_rows(results: Results) -> Iterator[dict[str, Any]]:
    """Yield one row for each group and kind of harm or deviation."""
    for row in results.conduct:
        for arm, (events, people) in row.counts.items():
            about = {"group": results.arms[arm], "kind": row.kind, "what": row.what}
            yield about | {"events": events, "participants": people}


def occurrence_rows(results: Results) -> Iterator[dict[str, Any]]:
    """Yield one row for each harm and deviation."""
    for one in results.occurrences:
        place = {"participant": one.participant, "group": results.arms[one.arm]}
        yield place | {
            "visit": one.visit,
            "kind": one.kind,
            "what": one.what,
            "value": one.value,
        }
