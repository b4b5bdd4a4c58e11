"""Moves of a clinic from one installation to another, by which its seals still verify.

A move adds the same number to all keys of a model, so that their order and gaps stay. Digests
that were sealed before name the keys of that time: `original_keys` leads back to them.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, ClassVar

from django.db import models
from django.db.models import Model

from rehab.people.append_only import Allowed, AppendOnlyModel
from rehab.people.models import Clinic
from rehab.people.scope import Scope

Translate = Callable[[type[Model], int], int]


def same_key(_model: type[Model], key: int) -> int:
    """Return a key as it is."""
    return key


class ClinicMove(AppendOnlyModel):
    """One import of a clinic. ``number``: from 1 on, over all installations it was in.

    ``shifts``: what was added to the keys of each model; ``shared``: by model, rows of all clinics
    that took the place of those there; ``renamed``: by column, values that were taken here;
    ``digests``: of the rows of each model, as the file has them. Until ``finished_at`` the import
    is not complete.
    """

    scope = Scope(clinic="clinic")
    allowed_changes = (
        Allowed(("finished_at",), "OLD.finished_at IS NULL AND NEW.finished_at IS NOT NULL"),
    )

    clinic = models.ForeignKey(Clinic, on_delete=models.PROTECT, related_name="moves")
    number = models.PositiveIntegerField()
    file = models.CharField(max_length=64)
    exported_at = models.DateTimeField()
    at = models.DateTimeField()
    finished_at = models.DateTimeField(null=True)
    shifts = models.JSONField()
    shared = models.JSONField(default=dict)
    renamed = models.JSONField(default=dict)
    digests = models.JSONField()

    class Meta(AppendOnlyModel.Meta):
        verbose_name = "move of a clinic"
        ordering: ClassVar = ["clinic", "number"]
        constraints: ClassVar = [
            models.UniqueConstraint(fields=["clinic", "number"], name="clinic_moved_in_order")
        ]

    def __str__(self) -> str:
        return f"{self.clinic}: {self.number}"

    def new_key(self, model: type[Model], key: int) -> int:
        """Return the key that a row has since this move."""
        label = model._meta.label_lower
        shared: dict[str, int] = self.shared.get(label, {})
        return shared.get(str(key), key + int(self.shifts.get(label, 0)))

    def old_key(self, model: type[Model], key: int) -> int:
        """Return the key that a row had before this move."""
        label = model._meta.label_lower
        for old, new in self.shared.get(label, {}).items():
            if new == key:
                return int(old)
        return key - int(self.shifts.get(label, 0))


def moves_of(clinic_id: int | None) -> list[ClinicMove]:
    """Return a clinic's moves, the newest first."""
    rows = ClinicMove.everywhere.filter(clinic=clinic_id).order_by("-number")
    return list(rows) if clinic_id is not None else []


def original_keys(moves: list[ClinicMove], known: int) -> Translate:
    """Return the function to the keys of before the moves that followed the first ``known``."""
    later = [move for move in moves if move.number > known]

    def translate(model: type[Model], key: int) -> int:
        for move in later:
            key = move.old_key(model, key)
        return key

    return translate if later else same_key


def translate_json(value: Any, translate: Callable[[int], int]) -> Any:
    """Return a key, or a list of keys, with each key translated; all else as it is."""
    if isinstance(value, list):
        return [translate_json(each, translate) for each in value]
    is_key = isinstance(value, int) and not isinstance(value, bool)
    return translate(value) if is_key else value
