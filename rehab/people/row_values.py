"""Keys of rows as forms name them, and saving of what was changed of a row and nothing else."""

from __future__ import annotations

from copy import deepcopy
from typing import Any

from django.db.models import Model

Values = dict[str, Any]


def read_values(row: Model) -> Values:
    """Return a row's values by column, as they are now."""
    return {
        field.attname: deepcopy(getattr(row, field.attname)) for field in row._meta.concrete_fields
    }


def save_changes(row: Model, before: Values) -> None:
    """Save the columns of a stored row that differ from its values ``before``, and no other."""
    fields = row._meta.concrete_fields
    row.save(
        update_fields=[
            field.name for field in fields if getattr(row, field.attname) != before[field.attname]
        ]
    )


DIGITS_MAX = 18  # of a key that every database can hold; Python itself refuses some thousands


def read_key(text: str) -> int:
    """Return a row's key; 0, which no row has, for any other text."""
    return int(text) if text.isdecimal() and len(text) <= DIGITS_MAX else 0
