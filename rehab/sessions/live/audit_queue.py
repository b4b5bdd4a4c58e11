"""What sockets tell the audit log. Whatever waits is written together: thousands of pages that come
back after a restart cost the disk a few commits, and no step waits for them.
"""

from __future__ import annotations

import asyncio
import contextvars
import logging
from collections.abc import Mapping
from datetime import datetime
from typing import Any, NamedTuple

from channels.db import database_sync_to_async
from django.db import DatabaseError

from rehab.people.audit import audit_log
from rehab.people.audit.audit_log import Act
from rehab.sessions.live.auth import Actor, address_of
from rehab.sessions.models import TrainingSession

log = logging.getLogger(__name__)


class Note(NamedTuple):
    """Something to be noted, with all but whose session it is."""

    session_id: int
    act: Act
    actor: Actor
    facts: dict[str, Any]


class Notes:
    """Keeps what is to be noted until it is written, beside everything else."""

    def __init__(self) -> None:
        self._waiting: list[Note] = []
        self._writing: asyncio.Task[None] | None = None

    def add(
        self, act: Act, actor: Actor, session_id: int, scope: Mapping[str, Any], now: datetime
    ) -> None:
        """Note what was seen or ordered by a socket; what is only seen once in some minutes."""
        path = scope["path"]
        key = (type(actor).__name__, getattr(actor, "pk", None), path)
        if act is Act.VIEW and not audit_log.recent_views.is_new(key, now):
            return
        facts = {"about": path, "address": address_of(scope), "now": now}
        self._waiting.append(Note(session_id, act, actor, facts))
        if self._writing is None:
            loop = asyncio.get_running_loop()
            self._writing = loop.create_task(self._write(), context=contextvars.Context())

    async def _write(self) -> None:
        notes: list[Note] = []
        try:
            while self._waiting:
                notes, self._waiting = self._waiting, []
                await database_sync_to_async(_store)(notes)
        except DatabaseError:  # care goes on, and later notes are tried again
            log.exception("The audit log missed what sockets told it: %s", notes)
        finally:
            self._writing = None

    async def settled(self) -> None:
        """Wait until all is written."""
        if self._writing is not None:
            await self._writing


def _store(notes: list[Note]) -> None:
    sessions = TrainingSession.everywhere.filter(pk__in={note.session_id for note in notes})
    patients = dict(sessions.values_list("pk", "patient_id"))
    audit_log.record_after_the_fact(
        [
            audit_log.build_entry(
                note.act, note.actor, patient_id=patients[note.session_id], **note.facts
            )
            for note in notes
            if note.session_id in patients
        ]
    )
