"""What alters boards: says so to `entries` the moment that it happens."""

from __future__ import annotations

from collections.abc import Callable
from functools import wraps
from typing import Any

from django.db.models import Model
from django.db.models.signals import m2m_changed, post_delete, post_save

from rehab.boards import building, entries
from rehab.boards.models import Leaderboard
from rehab.people.models import Clinic, Patient
from rehab.sessions.corrections import Part, SessionCorrection
from rehab.sessions.log import SessionMetric, figures_stored
from rehab.sessions.models import TrainingSession
from rehab.training.changes import State

STANDING = frozenset({"boards", "blinded", "simulated"})  # what of a patient alters boards


def watch() -> None:
    """Listen, from the start of the process on."""
    figures_stored.connect(on_figures)
    post_save.connect(on_patient, sender=Patient)
    post_save.connect(on_session, sender=TrainingSession)
    post_delete.connect(on_session, sender=TrainingSession)
    post_save.connect(on_correction, sender=SessionCorrection)
    post_save.connect(on_figure, sender=SessionMetric)
    post_delete.connect(on_figure, sender=SessionMetric)
    post_save.connect(on_board, sender=Leaderboard)
    m2m_changed.connect(on_group, sender=Leaderboard.group.through)
    post_save.connect(on_clinic, sender=Clinic)


def unless_restored(heed: Callable[..., None]) -> Callable[..., None]:
    """Leave out rows that a backup brings: their boards come with them."""

    @wraps(heed)
    def heed_people(instance: Model, raw: bool = False, **signal: Any) -> None:
        if not raw:
            heed(instance=instance, **signal)

    return heed_people


def on_figures(sessions: set[int], **_signal: Any) -> None:
    """Sessions have ended: part of the transaction that stores their figures."""
    ended = TrainingSession.everywhere.filter(pk__in=sessions)
    entries.refresh_patients(set(ended.values_list("patient_id", flat=True)))


@unless_restored
def on_patient(instance: Patient, created: bool, update_fields: Any = None, **_signal: Any) -> None:
    """A patient has agreed to more or less, or has entered or left a blinded study."""
    if not created and (update_fields is None or not STANDING.isdisjoint(update_fields)):
        entries.refresh_patients({instance.pk})


@unless_restored
def on_session(instance: TrainingSession, **_signal: Any) -> None:
    """A session was corrected or removed."""
    if instance.state == State.FINISHED:
        entries.refresh_patients({instance.patient_id})


@unless_restored
def on_correction(instance: SessionCorrection, **_signal: Any) -> None:
    """A session was given to whoever walked it: the one whom it was put down to has one less."""
    if instance.part == Part.PATIENT:
        before = Patient.everywhere.filter(pseudonym=instance.old)
        entries.refresh_patients(set(before.values_list("pk", flat=True)))


@unless_restored
def on_figure(instance: SessionMetric, **_signal: Any) -> None:
    """A figure was corrected or removed."""
    on_figures({instance.session_id})


@unless_restored
def on_board(instance: Leaderboard, **_signal: Any) -> None:
    """A board was made or changed."""
    building.rebuild(instance)


def on_group(instance: Leaderboard, action: str, **_signal: Any) -> None:
    """A board's group was chosen."""
    if action.startswith("post_"):
        building.rebuild(instance)


@unless_restored
def on_clinic(instance: Clinic, created: bool, **_signal: Any) -> None:
    """A clinic takes part in boards across clinics, or no longer."""
    if not created:
        for board in entries.boards_of(None):
            building.rebuild(board)
