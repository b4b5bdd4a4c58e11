"""What participants and assessors guess at the end about the group, so that blinding is measured.

A guess is a sealed event of the study; an erasure empties it like all words of events.
"""

from __future__ import annotations

from collections.abc import Iterator
from datetime import datetime
from enum import StrEnum
from typing import Any

from django.db import transaction
from django.utils.translation import gettext
from django.utils.translation import gettext_lazy as _

from rehab.people.models import User
from rehab.studies.allocation.crossover import crossover_groups
from rehab.studies.allocation.groups_and_strata import Group
from rehab.studies.analysis.blinding_index import bang_index, james_index
from rehab.studies.models import Study, StudyMark, StudyState, has_mark
from rehab.studies.participants import Enrollment, StudyEvent
from rehab.studies.registration.lifecycle import lock, note
from rehab.studies.visits import next_visit
from rehab.training.changes import OPEN_STATES
from rehab.training.measures import InvalidSetting

Kind = StudyEvent.Kind


class Guesser(StrEnum):
    """Whose guess it is."""

    PARTICIPANT = "participant"
    ASSESSOR = "assessor"


GUESSERS = {Guesser.PARTICIPANT: _("Participant"), Guesser.ASSESSOR: _("Assessor")}
UNKNOWN = "?"  # who does not know


def group_labels(study: Study) -> dict[str, str]:
    """Return the groups' codes with the names of their arms, in the order of the arms."""
    names = {arm.code: arm.name for arm in study.arms.all()}
    groups = crossover_groups(list(names)) if study.crossover else [Group((one,)) for one in names]
    return {
        group.name: f"{group.name}: {', '.join(names[arm] for arm in group.arms)}"
        for group in groups
    }


def may_guess(enrollment: Enrollment, by: User) -> Guesser | None:
    """Return whose guess an account may note of a participant now; None for nobody's.

    The participant's once the own visits are over; the assessor's own once everybody's who was
    enrolled are. The question names the arms, as the protocol does, and never whose they are.
    """
    study = enrollment.study
    is_assessor = has_mark(study, by, StudyMark.Task.ASSESSOR)
    whose = Guesser.ASSESSOR if is_assessor else Guesser.PARTICIPANT
    others = study.enrollments.filter(withdrawn_at=None) if is_assessor else []
    is_over = not any(map(_has_visits, (enrollment, *others)))
    known = StudyEvent.everywhere.filter(enrollment=enrollment, kind=Kind.GUESSED)
    asked = known.filter(about__startswith=f"{whose}: ").exists()
    return whose if study.state == StudyState.RUNNING and is_over and not asked else None


def _has_visits(enrollment: Enrollment) -> bool:
    """Return whether a participant has a visit to come, or walks the last one now."""
    walks = enrollment.visits.filter(session__state__in=[state.value for state in OPEN_STATES])
    return walks.exists() or (enrollment.withdrawn_at is None and bool(next_visit(enrollment)))


def record_guess(enrollment: Enrollment, group: str, by: User, now: datetime) -> None:
    """Record a guess, once.

    Parameters
    ----------
    enrollment
        The participant.
    group
        The code of the group that is guessed, or `UNKNOWN`.
    by, now
        Who notes it: an assessor the own guess, others the participant's; and when.

    Raises
    ------
    InvalidSetting
        Too early, too late, a second time, and for a group that the study does not have.
    """
    with transaction.atomic():
        lock(enrollment.study)
        whose = may_guess(enrollment, by)
        if whose is None:
            raise InvalidSetting(
                gettext(
                    "A guess is noted once: the participant’s after the last visit, an assessor’s "
                    "after everybody’s, and both before the study is closed."
                )
            )
        if group not in {*group_labels(enrollment.study), UNKNOWN}:
            raise InvalidSetting(gettext("Choose one of the groups, or “I do not know”."))
        note(
            enrollment.study,
            Kind.GUESSED,
            by,
            now,
            enrollment=enrollment,
            about=f"{whose}: {group}",
        )


def guess_rows(study: Study) -> Iterator[dict[str, Any]]:
    """Yield, for each guesser, counts and Bang's index of each group, then James's index of all.

    Bang's index is defined for two groups.
    """
    codes = [*group_labels(study), UNKNOWN]
    events = StudyEvent.everywhere.filter(study=study, kind=Kind.GUESSED, erased=False)
    found = list(events.values_list("about", "enrollment__allocation__group"))
    for whose in Guesser:
        pairs = [(group, text.split(": ")[1]) for text, group in found if text.startswith(whose)]
        counts = [[pairs.count((group, code)) for code in codes] for group in codes[:-1]]
        if not pairs:
            continue
        for place, (group, row) in enumerate(zip(codes, counts, strict=False)):
            index = bang_index(row, place) if len(counts) == 2 else None
            yield _row(whose, group, row, codes, "Bang", index)
        together = [sum(column) for column in zip(*counts, strict=True)]
        yield _row(whose, "", together, codes, "James", james_index(counts))


def _row(
    whose: Guesser, group: str, counts: list[int], codes: list[str], index: str, found: Any
) -> dict[str, Any]:
    guesses = {f"guessed_{code}": n for code, n in zip(codes[:-1], counts, strict=False)}
    return {
        "guesser": whose.value,
        "group": group,
        **guesses,
        "do_not_know": counts[-1],
        "index": index,
        "estimate": found and found.estimate,
        "low_95": found and found.low,
        "high_95": found and found.high,
    }
