"""Changes stored steps past their triggers, as a disk or a failover may."""

from __future__ import annotations

from typing import Any

from asgiref.sync import sync_to_async

from rehab.people.audit import append_only_triggers
from rehab.sessions.log import Step


@sync_to_async
def lose_steps(**which: Any) -> None:
    """Delete steps."""
    with append_only_triggers.lifted("default"):
        Step.everywhere.filter(**which).delete()


@sync_to_async
def change_steps(values: dict[str, Any], **which: Any) -> None:
    """Change steps."""
    with append_only_triggers.lifted("default"):
        Step.everywhere.filter(**which).update(**values)
