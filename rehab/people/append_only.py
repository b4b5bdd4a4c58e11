"""Rows that are only ever added: triggers in the database refuse every other change.

A model says which changes its triggers let through; `people/audit/append_only_triggers.py` installs
them.
"""

from __future__ import annotations

from typing import ClassVar, NamedTuple

from rehab.people.scope import ScopedModel


class Allowed(NamedTuple):
    """A change that is let through: of these fields alone, and where a condition holds.

    The condition is SQL about the rows OLD and NEW, one for all databases or one for each.
    """

    fields: tuple[str, ...]
    condition: str | dict[str, str]


class AppendOnlyModel(ScopedModel):
    """A model whose rows can be added and read."""

    allowed_changes: ClassVar[tuple[Allowed, ...]] = ()
    allowed_deletion: ClassVar[str] = "1 = 0"  # SQL about the row OLD

    class Meta(ScopedModel.Meta):
        abstract = True


# Of an account that is deleted nothing is left in what it did.
ACCOUNT_DELETED = Allowed(("by",), "NEW.by_id IS NULL")
