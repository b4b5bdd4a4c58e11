"""Who was erased and must not come back: participants whom the original's database still names.

What is kept is a keyed hash of the clinic and the original's number. It answers one question,
whether this very number was erased here, to whoever holds the server's key. It leads
to no row of ours.
"""

from __future__ import annotations

from typing import ClassVar

from django.db import models
from django.utils.crypto import salted_hmac
from django.utils.translation import gettext_lazy as _

from rehab.people.models import Clinic
from rehab.people.scope import Scope, ScopedModel


class ErasedOriginal(ScopedModel):
    """A participant of the original GARRY who was erased at a clinic."""

    scope = Scope(clinic="clinic")

    clinic = models.ForeignKey(
        Clinic, on_delete=models.CASCADE, related_name="+", verbose_name=_("clinic")
    )
    mark = models.CharField(max_length=64)

    class Meta(ScopedModel.Meta):
        constraints: ClassVar = [
            models.UniqueConstraint(fields=["clinic", "mark"], name="erased_once_per_clinic")
        ]

    def __str__(self) -> str:
        return self.mark[:8]


def keep_away(clinic: int, original_id: int) -> None:
    """Remember that a participant was erased."""
    ErasedOriginal.everywhere.get_or_create(clinic_id=clinic, mark=_mark(clinic, original_id))


def is_kept_away(clinic: int, original_id: int) -> bool:
    """Whether a participant was erased here."""
    mark = _mark(clinic, original_id)
    return ErasedOriginal.everywhere.filter(clinic=clinic, mark=mark).exists()


def _mark(clinic: int, original_id: int) -> str:
    hashed = salted_hmac(__name__, f"{clinic} {original_id}", algorithm="sha256")
    return hashed.hexdigest()
