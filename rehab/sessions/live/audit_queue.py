"""Queues the audit entries of sockets.

All pending entries are written together, so that thousands of pages that reconnect after a restart
cost a few commits and no step waits for them. While the database is away they wait.
"""

from __future__ import annotations

import asyncio
import contextvars
import logging
from collections.abc import Mapping
from datetime import datetime
from typing import Any, NamedTuple

from channels.db import database_sync_to_async
from django.db import Error, InterfaceError, OperationalError, transaction

from rehab.people.audit import audit_log
from rehab.people.audit.audit_log import Act, AuditEntry
from rehab.sessions.live.auth import Actor, socket_address
from rehab.sessions.models import TrainingSession

log = logging.getLogger(__name__)

RETRY_S = 1.0
MAX_WAITING = 10_000  # entries; newer ones are in the server's log alone


class PendingEntry(NamedTuple):
    """An audit entry that still lacks its patient."""

    session_id: int
    act: Act
    actor: Actor
    details: dict[str, Any]


class AuditQueue:
    """Collects audit entries and writes them in the background."""

    def __init__(self) -> None:
        self._pending: list[PendingEntry] = []
        self._write_task: asyncio.Task[None] | None = None
        self._is_ending = False  # what cannot be written now is lost

    def add(
        self, act: Act, actor: Actor, session_id: int, scope: Mapping[str, Any], now: datetime
    ) -> None:
        """Queue what a socket saw or ordered; of what it sees, one entry in some minutes."""
        path = scope["path"]
        key = (type(actor).__name__, getattr(actor, "pk", None), path)
        if act is Act.VIEW and not audit_log.recent_views.is_new(key, now):
            return
        details = {"about": path, "address": socket_address(scope), "now": now}
        self._pending.append(PendingEntry(session_id, act, actor, details))
        if self._write_task is None:
            loop = asyncio.get_running_loop()
            self._write_task = loop.create_task(self._write(), context=contextvars.Context())

    async def _write(self) -> None:
        try:
            while self._pending:
                entries, self._pending = self._pending, []
                try:
                    await database_sync_to_async(_store)(entries)
                except Error as problem:  # the training goes on
                    is_away = isinstance(problem, OperationalError | InterfaceError)
                    if self._is_ending or not is_away:
                        log.exception("The audit log lacks entries of sockets: %s", entries)
                    else:
                        self._requeue(entries)
                        await asyncio.sleep(RETRY_S)
        finally:
            self._write_task = None

    def _requeue(self, entries: list[PendingEntry]) -> None:
        """Queue entries again that could not be written, before those that came meanwhile."""
        waiting = [*entries, *self._pending]
        self._pending = waiting[:MAX_WAITING]
        if waiting[MAX_WAITING:]:
            log.error("The audit log lacks entries of sockets: %s", waiting[MAX_WAITING:])

    async def join(self) -> None:
        """Wait until all entries are written, or cannot be."""
        self._is_ending = True
        try:
            if self._write_task is not None:
                await self._write_task
        finally:
            self._is_ending = False


@transaction.atomic
def _store(entries: list[PendingEntry]) -> None:
    sessions = TrainingSession.everywhere.filter(pk__in={entry.session_id for entry in entries})
    patients = dict(sessions.values_list("pk", "patient_id"))
    built = [
        audit_log.build_entry(
            entry.act, entry.actor, patient_id=patients[entry.session_id], **entry.details
        )
        for entry in entries
        if entry.session_id in patients
    ]
    AuditEntry.everywhere.bulk_create(entry for entry in built if not _may_repeat(entry))
    for entry in _count_repeats([entry for entry in built if _may_repeat(entry)]):
        audit_log.add_or_count(entry)


def _may_repeat(entry: AuditEntry) -> bool:
    """Return whether an entry is a stop from a tablet, which anyone may press again and again."""
    return entry.act == Act.ROBOT_STOP and entry.by_id is None


def _count_repeats(entries: list[AuditEntry]) -> list[AuditEntry]:
    """Return one entry for each tablet and session, with the number of its stops."""
    counted: dict[tuple[str, str], AuditEntry] = {}
    for entry in entries:
        first = counted.setdefault((entry.through, entry.about), entry)
        first.count += first is not entry
    return list(counted.values())
