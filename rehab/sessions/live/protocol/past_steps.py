"""Past steps of a session, read from its log for clients that are authorized already."""

from __future__ import annotations

from channels.db import database_sync_to_async

from rehab.sessions.log import Step

PAGE_STEPS = 256  # steps of one query


@database_sync_to_async
def read_backlog(session_id: int, after: int, until: int) -> list[Step]:
    """Return the next page of steps after one number up to another, oldest first."""
    steps = Step.everywhere.filter(session_id=session_id, number__gt=after, number__lte=until)
    return list(steps.order_by("number")[:PAGE_STEPS])
