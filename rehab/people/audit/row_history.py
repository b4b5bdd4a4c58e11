"""The history of a row as text, for people who may see the row."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

from django.db.models import Field, ForeignKey, Model, Q
from django.utils.translation import gettext as _

from rehab.people.audit.history import HistoryEntry
from rehab.people.roles import Right, may_see_names, rights_of
from rehab.people.scope import ScopedModel

MAX_ENTRIES = 200  # the newest


@dataclass(frozen=True, slots=True)
class FieldChange:
    """The change of one field, as text."""

    label: str
    old: str
    new: str


@dataclass(frozen=True, slots=True)
class RowChange:
    """A change as text. ``part``: the kind of a row that is a part of the page's own row.

    ``who``: the person, and the program or tablet; "" where the reader may not know staff.
    """

    entry: HistoryEntry
    who: str
    part: str
    fields: list[FieldChange]


def changes_of(user: Any, row: ScopedModel, parts: Sequence[type[Model]] = ()) -> list[RowChange]:
    """Return the changes of a row and of the rows of ``parts`` that refer to it, newest first."""
    models = {type(row).__name__: type(row), **{part.__name__: part for part in parts}}
    wanted = Q(model_name=type(row).__name__, object_id=row.pk)
    for part in parts:
        link = next(
            field.name
            for field in part._meta.concrete_fields
            if isinstance(field, ForeignKey) and field.related_model is type(row)
        )
        mine: Any = part
        keys = mine.objects.visible_to(user).filter(**{link: row.pk}).values("pk")
        deleted = Q(kind=HistoryEntry.Kind.DELETED, **{f"changes__{link}__0": row.pk})
        wanted |= Q(model_name=part.__name__) & (Q(object_id__in=keys) | deleted)
    entries = (
        HistoryEntry.objects.visible_to(user).filter(wanted).select_related("by")[:MAX_ENTRIES]
    )
    return [
        RowChange(
            entry,
            describe_actor(entry) if may_see_names(user.role) else "",
            ""
            if entry.model_name == type(row).__name__
            else str(models[entry.model_name]._meta.verbose_name),
            list(_field_changes(user, models[entry.model_name], entry)),
        )
        for entry in entries
    ]


def describe_actor(entry: Any) -> str:
    """Return who did what an entry of a log tells: the person, and the program or device used."""
    names = [str(entry.by)] if entry.by else []
    names += [entry.through] if entry.through else []
    return " · ".join(names) or _("the server")


def _field_changes(user: Any, model: type[Model], entry: HistoryEntry) -> Iterator[FieldChange]:
    fields = {
        field.name: field for field in (*model._meta.concrete_fields, *model._meta.many_to_many)
    }
    for name, pair in entry.changes.items():
        field: Any = fields.get(name)
        related: Any = getattr(field, "related_model", None)
        if related is not None and Right.VIEW not in rights_of(user.role, related.__name__):
            continue  # its number alone could be looked up elsewhere
        label = getattr(field, "verbose_name", name)
        if pair is None:
            yield FieldChange(str(label), _("erased"), "")
        elif entry.kind != HistoryEntry.Kind.DELETED:
            old, new = (_format_value(user, field, value) for value in pair)
            added = entry.kind == HistoryEntry.Kind.ADDED
            yield FieldChange(str(label), new, "") if added else FieldChange(str(label), old, new)


def _format_value(user: Any, field: Field[Any, Any] | None, value: Any) -> str:
    """Return a stored value as text. Rows that the reader may not see stay numbers."""
    if value in (None, ""):
        return "–"
    if isinstance(value, bool):
        return _("yes") if value else _("no")
    if isinstance(value, dict):  # for example text by language
        return "; ".join(f"{name}: {text}" for name, text in value.items()) or "–"
    related: Any = getattr(field, "related_model", None)
    keys = value if isinstance(value, list) else [value]
    if related is not None:
        visible = related.objects.visible_to(user).in_bulk(keys)
        return ", ".join(str(visible.get(key, f"#{key}")) for key in keys)
    choices = dict(getattr(field, "flatchoices", []))
    return ", ".join(str(choices.get(key, key)) for key in keys)
