"""A row's history in words, for those who may see the row."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

from django.db.models import Field, ForeignKey, Model, Q
from django.utils.translation import gettext as _

from rehab.people.audit.history import HistoryEntry
from rehab.people.scope import ScopedModel

SHOWN = 200  # the newest


@dataclass(frozen=True, slots=True)
class Line:
    """What became of one field."""

    label: str
    old: str
    new: str


@dataclass(frozen=True, slots=True)
class Told:
    """A change in words. ``part``: the kind of row on the page, where it is not the row itself."""

    entry: HistoryEntry
    part: str
    lines: list[Line]


def changes_of(user: Any, row: ScopedModel, parts: Sequence[type[Model]] = ()) -> list[Told]:
    """Give the changes of a row and of the rows of ``parts`` on its page, newest first."""
    models = {type(row).__name__: type(row), **{part.__name__: part for part in parts}}
    wanted = Q(noun=type(row).__name__, row=row.pk)
    for part in parts:
        link = next(
            field.name
            for field in part._meta.concrete_fields
            if isinstance(field, ForeignKey) and field.related_model is type(row)
        )
        mine: Any = part
        keys = mine.objects.visible_to(user).filter(**{link: row.pk}).values("pk")
        gone = Q(kind=HistoryEntry.Kind.DELETED, **{f"values__{link}__0": row.pk})
        wanted |= Q(noun=part.__name__) & (Q(row__in=keys) | gone)
    entries = HistoryEntry.objects.visible_to(user).filter(wanted).select_related("by")[:SHOWN]
    return [
        Told(
            entry,
            "" if entry.noun == type(row).__name__ else str(models[entry.noun]._meta.verbose_name),
            list(_tell(user, models[entry.noun], entry)),
        )
        for entry in entries
    ]


def _tell(user: Any, model: type[Model], entry: HistoryEntry) -> Iterator[Line]:
    fields = {
        field.name: field for field in (*model._meta.concrete_fields, *model._meta.many_to_many)
    }
    for name, pair in entry.values.items():
        field: Any = fields.get(name)
        label = getattr(field, "verbose_name", name)
        if pair is None:
            yield Line(str(label), _("erased"), "")
        elif entry.kind != HistoryEntry.Kind.DELETED:
            old, new = (_say(user, field, value) for value in pair)
            added = entry.kind == HistoryEntry.Kind.ADDED
            yield Line(str(label), new, "") if added else Line(str(label), old, new)


def _say(user: Any, field: Field[Any, Any] | None, value: Any) -> str:
    """Put a stored value into words. Rows that the reader may not see stay numbers."""
    if value in (None, ""):
        return "–"
    if isinstance(value, bool):
        return _("yes") if value else _("no")
    if isinstance(value, dict):  # words by language, say
        return "; ".join(f"{name}: {said}" for name, said in value.items()) or "–"
    related: Any = getattr(field, "related_model", None)
    keys = value if isinstance(value, list) else [value]
    if related is not None:
        seen = related.objects.visible_to(user).in_bulk(keys)
        return ", ".join(str(seen.get(key, f"#{key}")) for key in keys)
    choices = dict(getattr(field, "flatchoices", []))
    return ", ".join(str(choices.get(key, key)) for key in keys)
