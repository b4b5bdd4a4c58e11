"""Signal receivers that record what boards depend on, and keep snapshots up to date."""

from __future__ import annotations

from collections.abc import Collection
from typing import Any

from django.db.models.signals import m2m_changed, post_save, pre_save
from django.utils import timezone

from rehab.boards.cache_invalidation import record_changes
from rehab.boards.models import Leaderboard
from rehab.boards.snapshots import freeze_boards, update_snapshot, update_snapshots
from rehab.people.models import Clinic, Patient
from rehab.sessions.log import figures_stored

ELIGIBILITY_FIELDS = frozenset({"boards", "blinded", "simulated"})  # of a patient


def connect_receivers() -> None:
    """Connect the receivers, when the process starts."""
    figures_stored.connect(on_figures)
    pre_save.connect(before_patient, sender=Patient)
    post_save.connect(on_patient, sender=Patient)
    post_save.connect(on_board, sender=Leaderboard)
    m2m_changed.connect(on_group, sender=Leaderboard.group.through)


def on_figures(patients: Collection[int], corrected: bool = False, **_signal: Any) -> None:
    """Record that patients have other figures; correct snapshots where those were wrong."""
    record_changes(patients)
    if corrected:
        update_snapshots(patients, timezone.now(), corrected=True)


def before_patient(
    instance: Patient, raw: bool = False, update_fields: Any = None, **_signal: Any
) -> None:
    """Freeze the boards that are due before a patient agrees, or leaves."""
    if not raw and _may_change_eligibility(update_fields):
        freeze_boards([instance.clinic_id], timezone.now())


def on_patient(
    instance: Patient, raw: bool = False, update_fields: Any = None, **_signal: Any
) -> None:
    """Record that a patient may have agreed or withdrawn, or entered or left a blinded study."""
    if not raw and _may_change_eligibility(update_fields):
        record_changes({instance.pk})
        update_snapshots({instance.pk}, timezone.now())


def on_board(instance: Leaderboard, raw: bool = False, **_signal: Any) -> None:
    """Take the snapshot of a board that is frozen as of a past day."""
    if not raw and instance.frozen_on is not None:
        clinics = Clinic.everywhere.values_list("pk", flat=True)
        freeze_boards([instance.clinic_id] if instance.clinic_id else clinics, timezone.now())


def on_group(instance: Leaderboard, action: str, **_signal: Any) -> None:
    """Remove from a snapshot the patients who were taken out of the board's group."""
    if instance.has_group and action.startswith("post_"):
        update_snapshot(instance, None, timezone.now())


def _may_change_eligibility(update_fields: Any) -> bool:
    return update_fields is None or not ELIGIBILITY_FIELDS.isdisjoint(update_fields)
