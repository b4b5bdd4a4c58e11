"""Patients of running studies, and whose sessions these hide from an account."""

from __future__ import annotations

from django.db.models import QuerySet

from rehab.people.models.accounts import RUNNING, User
from rehab.people.models.patients import Patient
from rehab.people.roles import Role


def hidden_patients(user: User) -> QuerySet[Patient]:
    """Return the patients whose sessions an account must not see until their study is closed.

    Points, words and colors betray the feedback type. So an assessor of a study sees no session of
    its participants, and a researcher none of any running study: the mark that allows looks shows
    aggregates of groups without names, and a session would tell which group is which.
    Participants who have withdrawn stay hidden. The lookups are those of `rehab.studies.models`.
    """
    if user.role == Role.RESEARCHER:
        return Patient.everywhere.filter(enrollments__study__state=RUNNING)
    return Patient.everywhere.filter(
        enrollments__study__state=RUNNING,
        enrollments__study__marks__user=user,
        enrollments__study__marks__task="assessor",
        enrollments__study__marks__ended_at=None,
    )


def is_in_running_study(patient: Patient) -> bool:
    """Return whether a study that is not closed has, or had, this patient.

    Who has withdrawn counts: what the study hides would still reveal the arm to an assessor.
    """
    return patient.enrollments.filter(study__state=RUNNING).exists()
