"""Removes a clinic from this installation, with a certificate of what is gone."""

from __future__ import annotations

import hashlib
import json
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from datetime import datetime
from pathlib import Path
from typing import Any

from django.contrib.auth.hashers import UNUSABLE_PASSWORD_PREFIX
from django.core.serializers.json import DjangoJSONEncoder
from django.db import transaction
from django.utils import timezone

from rehab.exports.clinic.clinic_models import clinic_paths, removed_models
from rehab.exports.clinic.row_serialization import CannotMove, ClinicRows
from rehab.exports.clinic.sealed_file import (
    Content,
    check_no_session_runs,
    recordings_of,
    seal_everything,
)
from rehab.people.audit import audit_log, seals
from rehab.people.audit.audit_log import Act
from rehab.people.models import Clinic, User
from rehab.people.roles import Role
from rehab.sessions import seals as session_seals
from rehab.sessions.live.database import clinic_owners
from rehab.sessions.models import TrainingSession
from rehab.stations.models import Device

PENDING = "This clinic is being removed from this installation of GARRY: pending."
REMOVED = "This clinic was removed from this installation of GARRY."
BATCH_ROWS = 500
REST = 1.0  # times as long as a small transaction took is waited after it
LEAVES_WITHIN_S = 90.0  # until servers have closed the sockets of accounts and devices
# What only says how the server is used: it grows by being looked at.
GROWS = {"auditentry", "logseal", "sessionseal", "user", "device", "apitoken", "familylink"}


def remove_clinic(
    clinic: Clinic,
    content: Content | None,
    by: str,
    now: datetime,
    *,
    wait_s: float,
    store: Callable[[str], None],
    receipt: str = "",
) -> str:
    """Remove a clinic and all that is its; return the digest of its certificate.

    ``content``: of the file that it leaves with, or ``receipt``: of the installation that took it
    in; without both its data is to be destroyed. ``store``: writes the certificate, as pending
    before anything is deleted. Raises CannotMove while sessions run, where file or receipt are not
    of this clinic as it is, and where servers do not let it go.
    """
    check_no_session_runs(clinic)
    _read_all(clinic, content, receipt, now)  # first, so that nobody is shut out in vain
    with _shut(clinic, now):
        _wait_for_servers(clinic, wait_s)
        check_no_session_runs(clinic)
        rows = _read_all(clinic, content, receipt, now)
        certificate = {
            "certificate": PENDING,
            "clinic": clinic.name,
            "removed_at": now,
            "by": by,
            "left_with_file": content.header["file"] if content else None,
            "left_with_receipt": receipt or None,
            "rows": rows.counts,
            "digests_of_rows": rows.digests,
            "last_seals": last_seals(clinic.pk),
            "recordings": [path.name for path in _own_recordings(clinic)],
            "not_in_here": "Backups from before hold it until they are deleted: /help/hosting/.",
        }
        store(_to_text(certificate))
    return finish_removal(clinic, certificate, now, store=store)


def finish_removal(
    clinic: Clinic | None,
    certificate: dict[str, Any],
    now: datetime,
    *,
    store: Callable[[str], None],
) -> str:
    """Delete what is left of a clinic (None: nothing); complete its certificate, as above."""
    deleted = {}
    if clinic is not None:
        for path in _own_recordings(clinic):
            path.unlink(missing_ok=True)
        deleted = delete_rows(clinic.pk)
    text = _to_text(certificate | {"certificate": REMOVED, "deleted": deleted})
    digest = hashlib.sha256(text.encode()).hexdigest()
    about = f"{certificate['clinic'][:100]}: {certificate['by'][:30]}, certificate {digest}"
    audit_log.record(Act.CLINIC_OUT, None, about=about, now=now)
    store(text)
    return digest


def _to_text(certificate: dict[str, Any]) -> str:
    return json.dumps(certificate, cls=DjangoJSONEncoder, indent=1, ensure_ascii=False) + "\n"


def _read_all(clinic: Clinic, content: Content | None, receipt: str, now: datetime) -> ClinicRows:
    """Return all rows with counts and digests. Raises CannotMove where others have left."""
    seal_everything(clinic, now)
    rows = ClinicRows(clinic.pk, with_tokens=content is not None and content.header["tokens"])
    for _ in rows.lines():
        pass
    if content is not None:
        compare_with_file(clinic, content, rows.digests)
    if receipt and receipt != make_receipt(rows.digests):
        raise CannotMove(
            f"{clinic} is not as the receipt says: it was changed since the export, or the receipt "
            "is of another one. Remove it there, export it again, and take it in there again."
        )
    return rows


def make_receipt(digests: dict[str, str]) -> str:
    """Return what only an installation that has all rows of a clinic can say, but for use."""
    kept = {label: digests[label] for label in digests if not _grows(label)}
    return hashlib.sha256(json.dumps(kept, sort_keys=True).encode()).hexdigest()


def _grows(label: str) -> bool:
    return label.removeprefix("rehab.") in GROWS


@contextmanager
def _shut(clinic: Clinic, now: datetime) -> Iterator[None]:
    """End all sign-ins and tokens of a clinic's people and devices, for good unless this fails."""
    people = User.everywhere.filter(clinic=clinic, is_active=True)
    devices = Device.everywhere.filter(clinic=clinic, revoked_at=None)
    keys = [list(rows.values_list("pk", flat=True)) for rows in (people, devices)]
    with transaction.atomic():
        people.update(is_active=False)
        devices.update(revoked_at=now)
    try:
        yield
    except BaseException:
        with transaction.atomic():
            User.everywhere.filter(pk__in=keys[0]).update(is_active=True)
            Device.everywhere.filter(pk__in=keys[1]).update(revoked_at=None)
        clinic_owners.release([clinic.pk])
        raise


def _wait_for_servers(clinic: Clinic, wait_s: float) -> None:
    """Own the clinic, so that no server writes to it any more. Raises CannotMove."""
    until_s = time.monotonic() + wait_s
    while True:
        try:
            clinic_owners.claim(clinic.pk)
            return
        except clinic_owners.OwnedElsewhere as problem:
            if time.monotonic() > until_s:
                raise CannotMove(
                    f"A server still has {clinic}, though nobody could sign in meanwhile. Restart "
                    "the server, then run this again."
                ) from problem
            time.sleep(0.5)


def compare_with_file(clinic: Clinic, content: Content, found: dict[str, str]) -> None:
    """Raise CannotMove where a file is not of a clinic as it is now."""
    differing = [
        label.removeprefix("rehab.")
        for label, digest in content.digests.items()
        if found[label] != digest and not _grows(label)
    ]
    if differing:
        raise CannotMove(
            f"{clinic} is not as the file has it ({', '.join(differing)}): it was changed since, "
            "or the file is of another one. Export it again."
        )


def last_seals(clinic_id: int) -> dict[str, str]:
    """Return the digest at the end of each chain of a clinic."""
    found: dict[str, Any] = {
        log: seals.seals_of(log, clinic_id).last() for log in seals.sealed_models()
    }
    found["steps and events"] = session_seals.last_seal(clinic_id)
    return {log: seal.digest for log, seal in found.items() if seal is not None}


def _own_recordings(clinic: Clinic) -> list[Path]:
    """Return the recordings that only this clinic's sessions name."""
    others = TrainingSession.everywhere.exclude(clinic=clinic)
    return [
        path
        for path in recordings_of(clinic)
        if not others.filter(source=f"recording {path.name}").exists()
    ]


@contextmanager
def transaction_and_rest() -> Iterator[None]:
    """Keep a small transaction, then wait: other clinics' sessions go on."""
    began_s = time.monotonic()
    with transaction.atomic():
        yield
    time.sleep(REST * (time.monotonic() - began_s))


def delete_rows(clinic_id: int) -> dict[str, int]:
    """Delete all rows of a clinic, in small transactions; return how many of each model."""
    # From here on the database lets rows go that are only added otherwise.
    Clinic.everywhere.filter(pk=clinic_id).update(removing_at=timezone.now())
    _hand_accounts_on(clinic_id)
    deleted: dict[str, int] = {}
    for model in removed_models():
        mine, count = model._base_manager.filter(**{clinic_paths()[model]: clinic_id}), 0
        while keys := list(mine.order_by("pk").values_list("pk", flat=True)[:BATCH_ROWS]):
            some = model._base_manager.filter(pk__in=keys)
            with transaction_and_rest():
                count += some._raw_delete(some.db)  # noqa: SLF001
        deleted[model._meta.label_lower] = count
    return deleted


def _hand_accounts_on(clinic_id: int) -> None:
    """Leave accounts that did something elsewhere there, where the log names them: shut."""
    for model, path in clinic_paths().items():
        for one in model._meta.concrete_fields:
            if one.related_model is not User:
                continue
            elsewhere = model._base_manager.filter(**{f"{one.name}__clinic": clinic_id})
            elsewhere = elsewhere.exclude(**{path: clinic_id}).order_by()
            for account, other in elsewhere.values_list(one.attname, path).distinct():
                role = {"role": Role.HOST} if other is None else {}
                User.everywhere.filter(pk=account).update(
                    clinic_id=other, is_active=False, password=UNUSABLE_PASSWORD_PREFIX, **role
                )
