"""A study's results, and who may look at them when."""

from __future__ import annotations

from dataclasses import dataclass
from datetime import date, datetime
from functools import cached_property
from hashlib import sha256

from django.utils.translation import gettext

from rehab.people.models import User
from rehab.people.roles import Role
from rehab.sessions.formatting import clinic_time
from rehab.studies.analysis import sequential
from rehab.studies.analysis.comparison import Difference, holm
from rehab.studies.analysis.curves import Point
from rehab.studies.analysis.design_matrix import MIN_PARTICIPANTS
from rehab.studies.analysis.findings import Departure, OutcomeResult
from rehab.studies.analysis.participants import (
    CHANNEL,
    ArmFlow,
    Participant,
    by_arm,
    distinct,
    flow,
)
from rehab.studies.models import Study, StudyMark, StudyState, has_mark
from rehab.studies.participants import StudyEvent
from rehab.studies.registration.allocation_secret import unseal
from rehab.studies.registration.lifecycle import note
from rehab.studies.registration.outcome_changes import (
    OutcomeChange,
    RegisteredOutcome,
    outcome_changes,
    registered_outcomes,
)
from rehab.studies.results.harms_and_deviations import (
    ConductRow,
    Occurrence,
    count,
    read_occurrences,
    unwalked,
)
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


def note_look(results: Results, user: User, now: datetime) -> None:
    """Record an interim look among the study's events: once a day, person and number of people.

    Parameters
    ----------
    results
        What is looked at.
    user, now
        Who looks, and when.
    """
    study = results.study
    if study.state == StudyState.CLOSED:
        return
    today = clinic_time(now, study.clinic).date()
    looks = StudyEvent.everywhere.filter(study=study, kind=StudyEvent.Kind.LOOKED, by=user)
    last, about = looks.order_by("-at").first(), f"{results.information}/{study.participants}"
    if last is None or (clinic_time(last.at, study.clinic).date(), last.about) != (today, about):
        note(study, StudyEvent.Kind.LOOKED, user, now, about=about)


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
    looks
        How many had the primary outcome at each earlier look, growing.
    """

    study: Study
    analysis: Analysis
    arms: dict[str, str]
    outcomes: tuple[RegisteredOutcome, ...]
    changes: tuple[OutcomeChange, ...]
    occurrences: tuple[Occurrence, ...]
    assessed: Assessed
    looks: tuple[int, ...] = ()

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
        known = (one for one in self.outcomes if one.slug in self.study.outcomes)
        return {one.slug: one for one in known if one.slug not in hidden}

    @cached_property
    def exploratory(self) -> tuple[str, ...]:
        """Slugs of all other outcomes that anybody has, one variable once."""
        if self.is_interim:
            return ()
        found = {slug for one in self.participants for v in one.visits for slug in v.outcomes}
        rest = [
            slug for slug in self.study.outcomes if slug in found and slug not in self.registered
        ]
        rest += sorted(slug for slug in found if slug.startswith(CHANNEL))
        known = distinct(self.participants, [*self.registered, *rest])
        return tuple(slug for slug in rest if slug in known)

    def find(self, slug: str) -> OutcomeResult:
        """Return what was found of an outcome."""
        if self.is_interim:
            return self.analysis.find(slug, frozenset()).without_few()
        return self.analysis.find(slug, self.departures)

    @cached_property
    def departures(self) -> frozenset[Departure]:
        """Who departed from the protocol, at which visit: not analyzed per protocol."""
        return frozenset(
            (one.participant, one.visit) for one in self.occurrences if not one.is_harm
        )

    @cached_property
    def information(self) -> int:
        """How many participants have the primary outcome."""
        people = (one for one in self.participants if one.is_analyzed)
        return sum(any(self.primary in visit.outcomes for visit in one.visits) for one in people)

    @cached_property
    def levels(self) -> tuple[tuple[int, float | None], ...]:
        """How many had the primary outcome at each look, now the last; below which p it is found.

        None at looks that were not planned: they may find nothing.
        """
        study, count = self.study, self.information
        if not count:
            return ()
        counts = [*(earlier for earlier in self.looks if earlier < count), count]
        is_last = not self.is_interim
        if not study.spending:
            levels = [None] * (len(counts) - 1) + [sequential.ALPHA if is_last else None]
        else:
            levels = [
                *sequential.levels(study.spending, counts, study.participants, is_last=is_last)
            ]
        return tuple(zip(counts, levels, strict=True))

    @property
    def level(self) -> float | None:
        """Below which p the primary outcome is found now; None where it was not planned."""
        return self.levels[-1][1] if self.levels else None

    @cached_property
    def blinded_size(self) -> tuple[float, int] | None:
        """The spread of all participants together, and how many it needs; None without a plan."""
        study, arms = self.study, list(self.arms)
        found = by_arm(self.participants, arms, self.primary).values()
        values = [value for people in found for value in people.values()]
        if study.planned_sd is None or len(values) < 2 * MIN_PARTICIPANTS:
            return None
        return sequential.blinded_size(values, study.planned_sd, study.participants)

    @cached_property
    def adjusted_p(self) -> dict[tuple[str, str, str], float]:
        """Holm's p by outcome, group and reference: of the primary's pairs, of all secondary's."""
        primary = [slug for slug in self.registered if slug == self.primary]
        secondary = [slug for slug in self.registered if slug != self.primary]
        found: dict[tuple[str, str, str], float] = {}
        for family in (primary, secondary):
            p = {
                (slug, one.group, one.reference): one.p
                for slug in family
                for one in self.find(slug).differences
                if one.p is not None
            }
            found |= dict(zip(p, holm(list(p.values())), strict=True))
        return found

    def tipping_point(self, slug: str, one: Difference) -> float | None:
        """Return how far missing visits would have to lie to change a conclusion, by Holm's p.

        Parameters
        ----------
        slug, one
            The outcome's; a difference of it.
        """
        adjusted = self.adjusted_p.get((slug, one.group, one.reference))
        return one.tipping_point(adjusted, self.level if slug == self.primary else None)

    def is_not_inferior(self, slug: str, one: Difference) -> bool | None:
        """Return whether a group is not worse by the margin; None where that is not asked.

        Parameters
        ----------
        slug, one
            The outcome's; a difference of it.
        """
        margin, level = self.study.margin, self.level
        if slug != self.primary or margin is None or level is None:
            return None
        better = self.study.outcomes[slug].higher_is_better
        return one.is_not_inferior(margin, higher_is_better=better, confidence=1 - level)

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
        _looks(study),
    )


def _looks(study: Study) -> tuple[int, ...]:
    looks = study.events.filter(kind=StudyEvent.Kind.LOOKED).values_list("about", flat=True)
    counts = (about.partition("/")[0] for about in looks)
    return tuple(sorted({int(count) for count in counts if count.isdecimal() and count != "0"}))
