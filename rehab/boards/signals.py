"""Signal receivers that update boards when rows change that they depend on."""

from __future__ import annotations

from collections.abc import Callable
from functools import wraps
from typing import Any

from django.db.models import Model
from django.db.models.signals import m2m_changed, post_delete, post_save, pre_save
from django.utils import timezone

from rehab.boards.building import entries, scheduler
from rehab.boards.models import Leaderboard
from rehab.people.models import Clinic, Patient
from rehab.sessions.corrections import CorrectedField, SessionCorrection
from rehab.sessions.log import SessionMetric, figures_stored
from rehab.sessions.models import TrainingSession
from rehab.training.changes import State

ELIGIBILITY_FIELDS = frozenset({"boards", "blinded", "simulated"})  # of a patient

PREVIOUS = "row before the save, for boards"


def connect_receivers() -> None:
    """Connect the receivers, when the process starts."""
    figures_stored.connect(on_figures)
    post_save.connect(on_patient, sender=Patient)
    post_save.connect(on_session, sender=TrainingSession)
    post_delete.connect(on_session, sender=TrainingSession)
    post_save.connect(on_correction, sender=SessionCorrection)
    post_save.connect(on_figure, sender=SessionMetric)
    post_delete.connect(on_figure, sender=SessionMetric)
    pre_save.connect(remember_previous, sender=Leaderboard)
    post_save.connect(on_board, sender=Leaderboard)
    m2m_changed.connect(on_group, sender=Leaderboard.group.through)
    pre_save.connect(remember_previous, sender=Clinic)
    post_save.connect(on_clinic, sender=Clinic)


def unless_restored(receiver: Callable[..., None]) -> Callable[..., None]:
    """Skip a receiver while a backup is restored, since boards are restored with it."""

    @wraps(receiver)
    def receive(instance: Model, raw: bool = False, **signal: Any) -> None:
        if not raw:
            receiver(instance=instance, **signal)

    return receive


def on_figures(**_signal: Any) -> None:
    """Let boards follow the sessions that have ended, in their thread."""
    scheduler.board_builder.wake()


def patients_of(sessions: set[int]) -> set[int]:
    """Return the patients of some sessions."""
    rows = TrainingSession.everywhere.filter(pk__in=sessions)
    return set(rows.values_list("patient_id", flat=True))


@unless_restored
def on_patient(instance: Patient, created: bool, update_fields: Any = None, **_signal: Any) -> None:
    """Update boards after a patient agreed, withdrew, or entered or left a blinded study."""
    if not created and (update_fields is None or not ELIGIBILITY_FIELDS.isdisjoint(update_fields)):
        entries.refresh_patients({instance.pk}, now=timezone.now())


@unless_restored
def on_session(instance: TrainingSession, created: bool = False, **_signal: Any) -> None:
    """Update boards after a session was corrected, removed or imported."""
    if instance.state == State.FINISHED:
        patients = {instance.patient_id}
        entries.refresh_patients(patients, now=timezone.now(), corrected=not created)


@unless_restored
def on_correction(instance: SessionCorrection, **_signal: Any) -> None:
    """Update boards of the patient to whom a session was assigned by mistake."""
    if instance.field == CorrectedField.PATIENT:
        before = Patient.everywhere.filter(pseudonym=instance.old)
        patients = set(before.values_list("pk", flat=True))
        entries.refresh_patients(patients, now=timezone.now(), corrected=True)


@unless_restored
def on_figure(instance: SessionMetric, created: bool = False, **_signal: Any) -> None:
    """Update boards after a metric was corrected, removed or imported."""
    patients = patients_of({instance.session_id})
    entries.refresh_patients(patients, now=timezone.now(), corrected=not created)


@unless_restored
def remember_previous(instance: Any, **_signal: Any) -> None:
    """Read the stored row before a save, to compare it afterwards."""
    vars(instance)[PREVIOUS] = type(instance).everywhere.filter(pk=instance.pk).first()


@unless_restored
def on_board(instance: Leaderboard, **_signal: Any) -> None:
    """Rebuild a board that is new, or of which more changed than how its rows are shown."""
    before: Leaderboard | None = vars(instance).pop(PREVIOUS, None)
    if before is None or before.defining_fields != instance.defining_fields:
        scheduler.rebuild(instance, timezone.now())


def on_group(instance: Leaderboard, action: str, pk_set: set[int] | None, **_signal: Any) -> None:
    """Update a board after patients were added to its group or removed from it."""
    if instance.has_group and action.startswith("post_"):
        scheduler.update_eligibility(instance, timezone.now(), pk_set)


@unless_restored
def on_clinic(instance: Clinic, **_signal: Any) -> None:
    """Update boards after a clinic changed its time zone or its part in boards across clinics."""
    before: Clinic | None = vars(instance).pop(PREVIOUS, None)
    if before is None:
        return
    joins = before.boards_across != instance.boards_across
    moves = before.time_zone != instance.time_zone
    for board in entries.boards_of([instance.pk]) if joins or moves else ():
        if joins if board.clinic_id is None else moves:
            scheduler.update_eligibility(board, timezone.now())
