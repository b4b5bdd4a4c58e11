"""The stored rows of leaderboards that groups of patients are on."""

from __future__ import annotations

from typing import ClassVar

from django.db import models

from rehab.boards.models import Leaderboard
from rehab.feedback.translation import valence_choices
from rehab.people.models import Patient
from rehab.people.scope import Scope, ScopedModel


class BoardEntry(ScopedModel):
    """A patient's stored row on a board of several patients.

    It is computed from the sessions that count (`building/entries.py`) and stored so that rows are
    found by index. ``key`` orders the rows: the greater, the better.
    """

    scope = Scope(clinic="patient__clinic")

    # No index for these columns alone: the composite ones below begin with them.
    board = models.ForeignKey(
        Leaderboard, on_delete=models.CASCADE, related_name="entries", db_index=False
    )
    patient = models.ForeignKey(Patient, on_delete=models.CASCADE, related_name="+", db_index=False)
    valence = models.CharField(max_length=16, blank=True, choices=valence_choices)
    figure = models.IntegerField(help_text="As it is shown: a whole number.")
    points_at_stake = models.IntegerField(
        null=True, help_text="The points that could be kept, where points can only be lost."
    )
    key = models.CharField(max_length=48)
    stale_on = models.DateField(null=True, help_text="The day from which it is out of date.")

    class Meta(ScopedModel.Meta):
        constraints: ClassVar = [
            models.UniqueConstraint(fields=["patient", "board", "valence"], name="board_entry_once")
        ]
        indexes: ClassVar = [
            models.Index(fields=["board", "valence", "key"], name="entry_by_place"),
            models.Index(fields=["board", "stale_on"], name="entry_by_staleness"),
        ]

    def __str__(self) -> str:
        return f"{self.figure}"


class BoardCount(ScopedModel):
    """How many rows of a board have one figure.

    Ranks are sums of these, so that no page counts the rows of a board.
    """

    scope = Scope(clinic="board__clinic")

    board = models.ForeignKey(
        Leaderboard, on_delete=models.CASCADE, related_name="counts", db_index=False
    )
    valence = models.CharField(max_length=16, blank=True)
    figure = models.IntegerField()
    rows = models.PositiveIntegerField()

    class Meta(ScopedModel.Meta):
        constraints: ClassVar = [
            models.UniqueConstraint(fields=["board", "valence", "figure"], name="board_count_once")
        ]

    def __str__(self) -> str:
        return f"{self.figure}: {self.rows}"
