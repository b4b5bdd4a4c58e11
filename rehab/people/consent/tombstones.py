"""Tombstones of erased patients, so that the import does not bring them back.

The legacy database still has them as participants. A tombstone is a keyed hash of the clinic and
the legacy id. With the server's key it shows whether a given id was erased here; it refers
to no other row.
"""

from __future__ import annotations

import hmac
from typing import ClassVar

from django.db import models
from django.utils.translation import gettext_lazy as _

from rehab.people.models import Clinic
from rehab.people.scope import Scope, ScopedModel
from rehab.people.server_keys import Purpose, stable_key, store_first


class ImportTombstone(ScopedModel):
    """A participant of the legacy database who was erased at a clinic."""

    scope = Scope(clinic="clinic")

    clinic = models.ForeignKey(
        Clinic, on_delete=models.CASCADE, related_name="+", verbose_name=_("clinic")
    )
    id_hash = models.CharField(max_length=64)

    class Meta(ScopedModel.Meta):
        constraints: ClassVar = [
            models.UniqueConstraint(
                fields=["clinic", "id_hash"], name="import_tombstone_once_per_clinic"
            )
        ]

    def __str__(self) -> str:
        return self.id_hash[:8]


def block_reimport(clinic_id: int, legacy_id: int) -> None:
    """Block a participant from being imported again."""
    store_first(Purpose.TOMBSTONES)
    ImportTombstone.everywhere.get_or_create(
        clinic_id=clinic_id, id_hash=_hash_id(clinic_id, legacy_id)
    )


def is_reimport_blocked(clinic_id: int, legacy_id: int) -> bool:
    """Return whether a participant was erased here."""
    id_hash = _hash_id(clinic_id, legacy_id)
    return ImportTombstone.everywhere.filter(clinic=clinic_id, id_hash=id_hash).exists()


def _hash_id(clinic_id: int, legacy_id: int) -> str:
    key = stable_key(Purpose.TOMBSTONES)
    return hmac.digest(key, f"{clinic_id} {legacy_id}".encode(), "sha256").hex()
