"""What alters boards: tells `entries` the moment that it happens, and what time it is."""

from __future__ import annotations

import logging
from collections.abc import Callable
from functools import partial, wraps
from typing import Any

from django.db import transaction
from django.db.models import Model
from django.db.models.signals import m2m_changed, post_delete, post_save, pre_save
from django.utils import timezone

from rehab.boards import building, entries
from rehab.boards.models import Leaderboard
from rehab.people.models import Clinic, Patient
from rehab.sessions.corrections import CorrectedField, SessionCorrection
from rehab.sessions.log import SessionMetric, figures_stored
from rehab.sessions.models import TrainingSession
from rehab.training.changes import State

STANDING = frozenset({"boards", "blinded", "simulated"})  # what of a patient alters boards

log = logging.getLogger(__name__)

BEFORE = "row that boards knew before the save"


def watch() -> None:
    """Listen, from the start of the process on."""
    figures_stored.connect(on_figures)
    post_save.connect(on_patient, sender=Patient)
    post_save.connect(on_session, sender=TrainingSession)
    post_delete.connect(on_session, sender=TrainingSession)
    post_save.connect(on_correction, sender=SessionCorrection)
    post_save.connect(on_figure, sender=SessionMetric)
    post_delete.connect(on_figure, sender=SessionMetric)
    pre_save.connect(look, sender=Leaderboard)
    post_save.connect(on_board, sender=Leaderboard)
    m2m_changed.connect(on_group, sender=Leaderboard.group.through)
    pre_save.connect(look, sender=Clinic)
    post_save.connect(on_clinic, sender=Clinic)


def unless_restored(heed: Callable[..., None]) -> Callable[..., None]:
    """Leave out rows that a backup brings: their boards come with them."""

    @wraps(heed)
    def heed_people(instance: Model, raw: bool = False, **signal: Any) -> None:
        if not raw:
            heed(instance=instance, **signal)

    return heed_people


def on_figures(sessions: set[int], **_signal: Any) -> None:
    """Sessions have ended: part of the transaction that stores their figures.

    Where that fails, figures are kept all the same, and the boards are built anew.
    """
    patients, now = patients_of(sessions), timezone.now()
    try:
        with transaction.atomic():
            entries.refresh_patients(patients, now=now)
    except Exception:
        log.exception(
            "Boards did not follow sessions %s. They are built anew; if they stay away, run "
            "manage.py rebuildboards",
            sessions,
        )
        transaction.on_commit(partial(building.heal, patients, now), robust=True)


def patients_of(sessions: set[int]) -> set[int]:
    """Give who walked some sessions."""
    rows = TrainingSession.everywhere.filter(pk__in=sessions)
    return set(rows.values_list("patient_id", flat=True))


@unless_restored
def on_patient(instance: Patient, created: bool, update_fields: Any = None, **_signal: Any) -> None:
    """A patient has agreed to more or less, or has entered or left a blinded study."""
    if not created and (update_fields is None or not STANDING.isdisjoint(update_fields)):
        entries.refresh_patients({instance.pk}, now=timezone.now())


@unless_restored
def on_session(instance: TrainingSession, created: bool = False, **_signal: Any) -> None:
    """A session was corrected or removed, or came from elsewhere."""
    if instance.state == State.FINISHED:
        patients = {instance.patient_id}
        entries.refresh_patients(patients, now=timezone.now(), corrected=not created)


@unless_restored
def on_correction(instance: SessionCorrection, **_signal: Any) -> None:
    """A session was given to whoever walked it: the one whom it was put down to has one less."""
    if instance.field == CorrectedField.PATIENT:
        before = Patient.everywhere.filter(pseudonym=instance.old)
        patients = set(before.values_list("pk", flat=True))
        entries.refresh_patients(patients, now=timezone.now(), corrected=True)


@unless_restored
def on_figure(instance: SessionMetric, created: bool = False, **_signal: Any) -> None:
    """A figure was corrected or removed, or came from elsewhere."""
    patients = patients_of({instance.session_id})
    entries.refresh_patients(patients, now=timezone.now(), corrected=not created)


@unless_restored
def look(instance: Any, **_signal: Any) -> None:
    """Read, before a save, what is there."""
    vars(instance)[BEFORE] = type(instance).everywhere.filter(pk=instance.pk).first()


@unless_restored
def on_board(instance: Leaderboard, **_signal: Any) -> None:
    """A board was made, or its rows are others now: how they are shown alters none."""
    before: Leaderboard | None = vars(instance).pop(BEFORE, None)
    if before is None or before.makings != instance.makings:
        building.rebuild(instance, timezone.now())


def on_group(instance: Leaderboard, action: str, pk_set: set[int] | None, **_signal: Any) -> None:
    """Patients were taken into a board's group or out of it."""
    if instance.has_group and action.startswith("post_"):
        building.follow(instance, timezone.now(), pk_set)


@unless_restored
def on_clinic(instance: Clinic, **_signal: Any) -> None:
    """A clinic's days begin at another hour, or it joins boards across clinics or leaves them."""
    before: Clinic | None = vars(instance).pop(BEFORE, None)
    if before is None:
        return
    joins = before.boards_across != instance.boards_across
    moves = before.time_zone != instance.time_zone
    for board in entries.boards_of([instance.pk]) if joins or moves else ():
        if joins if board.clinic_id is None else moves:
            building.follow(board, timezone.now())
