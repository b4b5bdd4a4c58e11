"""`manage.py rebuildboards`: make the rows of every leaderboard anew, from the sessions."""

from __future__ import annotations

from typing import Any

from django.core.management.base import BaseCommand

from rehab.boards.entries import refresh, tidy
from rehab.boards.models import BoardEntry, Leaderboard


class Command(BaseCommand):
    """Rebuilds boards, one by one; tablets show each again once it is done."""

    help = "Make the rows of every leaderboard anew, from the sessions."

    def handle(self, *args: Any, **options: Any) -> None:
        """Rebuild and say how many rows each board has."""
        for board in Leaderboard.everywhere.select_related("clinic").order_by("pk"):
            refresh(board)
            if options["verbosity"]:
                rows = BoardEntry.everywhere.filter(board=board).count()
                self.stdout.write(f"{board}: {rows} rows")
        tidy()
