"""Which patients may be on a board of several patients."""

from __future__ import annotations

from django.db.models import Q, QuerySet

from rehab.boards.choices import Participants
from rehab.boards.models import Leaderboard
from rehab.people.consent.models import Purpose, has_consented
from rehab.people.models import Patient
from rehab.people.models.accounts import RUNNING


def eligible_patients(board: Leaderboard) -> QuerySet[Patient]:
    """Return the patients who have agreed to be on a board and are in no blinded study.

    Who has left one stays away until it is closed: a board of one feedback type reveals the arm.
    """
    patients = Patient.everywhere.filter(boards__in=board.accepted_levels, blinded=False)
    patients = patients.exclude(enrollments__study__state=RUNNING)
    patients = patients.filter(Q(simulated=True) | has_consented(Purpose.BOARDS))
    if board.among == Participants.ACROSS:
        return patients.filter(clinic__boards_across=True)
    patients = patients.filter(clinic=board.clinic_id)
    return patients.filter(pk__in=find_group(board)) if board.has_group else patients


def find_group(board: Leaderboard) -> list[int]:
    """Return the patients of a board's group; of an unsaved form, those that it has chosen."""
    chosen: list[int] | None = getattr(board, "chosen", None)
    if chosen is not None:
        return chosen
    return list(board.group.values_list("pk", flat=True)) if board.pk else []
