"""`manage.py rebuildboards`: make the rows of every leaderboard anew, from the sessions.

Those of a frozen board stay, without who may no longer stand on it; they are counted anew.
"""

from __future__ import annotations

from typing import Any

from django.core.management.base import BaseCommand
from django.utils import timezone

from rehab.boards.entries import is_snapshot, refresh, thin_out, tidy
from rehab.boards.models import BoardEntry, Leaderboard


class Command(BaseCommand):
    """Rebuilds boards, one by one; tablets show each again once it is done."""

    help = "Make the rows of every leaderboard anew, from the sessions."

    def handle(self, *args: Any, **options: Any) -> None:
        """Rebuild and say how many rows each board has."""
        now = timezone.now()
        for board in Leaderboard.everywhere.select_related("clinic").order_by("pk"):
            if is_snapshot(board, now):
                thin_out(board)
            else:
                refresh(board, now=now)
            if options["verbosity"]:
                rows = BoardEntry.everywhere.filter(board=board).count()
                self.stdout.write(f"{board}: {rows} rows")
        tidy()
