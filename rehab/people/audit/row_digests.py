"""What makes a row of a log provable: a digest of its values, stored with it."""

from __future__ import annotations

import hashlib
import json
import secrets
from collections.abc import Iterable
from datetime import UTC, datetime
from typing import Any, ClassVar, Self, TypeVar

from django.core.serializers.json import DjangoJSONEncoder
from django.db import models

from rehab.people.append_only import AppendOnlyModel
from rehab.people.audit.moves import Translate, same_key

ERASED = "NEW.erased AND NEW.salt = ''"


def has_seal(log: str, condition: str) -> str:
    """Return the SQL condition that the chain of a row has a seal (``s``) with a condition."""
    return (
        f"EXISTS (SELECT 1 FROM rehab_logseal s WHERE s.log = '{log}' "  # noqa: S608  # no stranger's text
        f"AND s.clinic_id IS NOT DISTINCT FROM OLD.clinic_id AND {condition})"
    )


def is_cut(log: str) -> str:
    """Return the SQL condition that retention deletes the batch of a row."""
    return has_seal(log, "OLD.id BETWEEN s.first_id AND s.last_id AND s.cut_at IS NOT NULL")


M = TypeVar("M", bound="SealableModel")


class SealableRows(models.QuerySet[M]):
    """Rows of a log; each that is added gets its digest, also of many at once."""

    def bulk_create(self, objs: Iterable[M], *args: Any, **kwargs: Any) -> list[M]:
        """Add rows in one query, each with its digest."""
        rows = list(objs)
        for row in rows:
            row.set_digest()
        return super().bulk_create(rows, *args, **kwargs)


class SealableModel(AppendOnlyModel):
    """A row of a log, with a moment (``at``) and a digest of its values.

    The digest outlives the values: an erasure empties these and removes the salt, without which
    no one can guess what they were. `seals` chains the digests, of each clinic's rows by their
    ``scope``.
    """

    sealed_fields: ClassVar[tuple[str, ...]]

    everywhere: ClassVar[models.Manager[Self]] = models.Manager.from_queryset(SealableRows)()

    salt = models.CharField(max_length=32, blank=True, editable=False)
    digest = models.CharField(max_length=64, default="", editable=False)
    erased = models.BooleanField(default=False, editable=False)

    class Meta(AppendOnlyModel.Meta):
        abstract = True

    def save(self, *args: Any, **kwargs: Any) -> None:
        """Store the row, a new one with its digest."""
        if self._state.adding:
            self.set_digest()
        super().save(*args, **kwargs)

    def set_digest(self) -> None:
        """Set salt and digest of a new row."""
        self.salt = secrets.token_hex(16)
        self.digest = self.compute_digest()

    def compute_digest(self, original: Translate = same_key) -> str:
        """Return the digest of the salt and the sealed values as they are.

        ``original`` leads to the keys that rows had when this one was added.
        """
        text = json.dumps(self.sealed_values(original), sort_keys=True, ensure_ascii=False)
        return hashlib.sha256(f"{self.salt}\n{text}".encode()).hexdigest()

    def sealed_values(self, original: Translate) -> dict[str, Any]:
        """Return the sealed values by name, as every database gives them back."""
        values: dict[str, Any] = {}
        for name in self.sealed_fields:
            field: Any = self._meta.get_field(name)
            value = getattr(self, field.attname)
            if field.is_relation and value is not None:
                value = original(field.related_model, value)
            values[name] = plain(value)
        return values

    @property
    def is_emptied(self) -> bool:
        """Whether nothing is left of what an erasure empties."""
        return False

    def is_genuine(self, original: Translate = same_key) -> bool:
        """Return whether the row is as it was added, or as an erasure left it."""
        return self.is_emptied if self.erased else self.compute_digest(original) == self.digest


def plain(value: Any) -> Any:
    """Return a value as every database gives it back."""
    if isinstance(value, datetime):
        return value.astimezone(UTC).isoformat(timespec="microseconds")
    return json.loads(json.dumps(value, cls=DjangoJSONEncoder))


def with_floats(value: Any) -> Any:
    """Return stored values with all numbers as floats: databases write them in different ways."""
    match value:
        case bool() | None | str():
            return value
        case int() | float():
            return float(value) + 0.0  # no negative zero
        case dict():
            return {key: with_floats(each) for key, each in value.items()}
        case list() | tuple():
            return [with_floats(each) for each in value]
    return value
