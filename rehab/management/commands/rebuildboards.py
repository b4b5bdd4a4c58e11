"""`manage.py rebuildboards`: rebuild the rows of every leaderboard from the sessions.

Rows of a frozen board stay, without patients who are no longer eligible, and are recounted.
"""

from __future__ import annotations

from typing import Any

from django.core.management.base import BaseCommand
from django.utils import timezone

from rehab.boards.building.entries import (
    analyze_tables,
    drop_ineligible,
    is_snapshot,
    refresh,
)
from rehab.boards.models import Leaderboard
from rehab.boards.rows import BoardEntry


class Command(BaseCommand):
    """Rebuilds boards one by one; tablets show each of them again once it is done."""

    help = "Rebuild the rows of every leaderboard from the sessions."

    def handle(self, *args: Any, **options: Any) -> None:
        """Rebuild the boards and write how many rows each has."""
        now = timezone.now()
        for board in Leaderboard.everywhere.select_related("clinic").order_by("pk"):
            if is_snapshot(board, now):
                drop_ineligible(board)
            else:
                refresh(board, now=now)
            if options["verbosity"]:
                rows = BoardEntry.everywhere.filter(board=board).count()
                self.stdout.write(f"{board}: {rows} rows")
        analyze_tables()
