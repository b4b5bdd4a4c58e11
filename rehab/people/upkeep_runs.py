"""What a server does by itself, and how it went, for monitoring and `doctor`."""

from __future__ import annotations

from collections.abc import Mapping
from datetime import datetime
from typing import ClassVar

from django.db import models

TASK = "task "  # begins the name of what a running server repeats


class Chore(models.Model):
    """When a chore last succeeded and last failed, and what it said."""

    name = models.CharField(max_length=32, primary_key=True)
    succeeded_at = models.DateTimeField(null=True)
    failed_at = models.DateTimeField(null=True)
    said = models.TextField(blank=True)

    class Meta:
        ordering: ClassVar = ["name"]

    def __str__(self) -> str:
        return self.name

    @property
    def is_well(self) -> bool:
        """Whether its last run succeeded."""
        if self.succeeded_at is None or self.failed_at is None:
            return self.failed_at is None
        return self.succeeded_at > self.failed_at


def record_chore(name: str, said: str, now: datetime, *, failed: bool) -> None:
    """Record how a chore went."""
    moment = {"failed_at": now} if failed else {"succeeded_at": now}
    Chore.objects.update_or_create(name=name, defaults=moment | {"said": said[-2000:]})


def record_tasks(problems: Mapping[str, str], now: datetime) -> None:
    """Record how a server's periodic tasks went: "" is well. What never failed has no row."""
    well = [TASK + name for name, problem in problems.items() if not problem]
    Chore.objects.filter(name__in=well).update(succeeded_at=now, said="")
    for name, problem in problems.items():
        if problem:
            record_chore(TASK + name, problem, now, failed=True)
