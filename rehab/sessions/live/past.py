"""Past steps of a session that somebody was already let into, read from its log."""

from __future__ import annotations

from channels.db import database_sync_to_async

from rehab.sessions.models import Step

PAGE = 256  # past steps at a time


@database_sync_to_async
def read_steps(session_id: int, after: int, until: int) -> list[Step]:
    """Give the next steps after one number up to another, oldest first."""
    steps = Step.everywhere.filter(session_id=session_id, number__gt=after, number__lte=until)
    return list(steps.order_by("number")[:PAGE])


@database_sync_to_async
def read_step(session_id: int, number: int) -> Step:
    """Give a stored step."""
    return Step.everywhere.get(session_id=session_id, number=number)
