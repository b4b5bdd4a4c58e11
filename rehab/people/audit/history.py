"""Who changed what, and when: of people and of settings, each value before and after.

One table for all models. django-simple-history was weighed and left: it looks rows up by
`Model.objects` (ours refuses), opens a version by its number before it asks whose it is, and keeps
whole copies of patients in a dozen tables that an erasure would have to search.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import dataclass
from functools import partial
from typing import Any, ClassVar

from django.core.serializers.json import DjangoJSONEncoder
from django.db import models
from django.db.models import Model, Q
from django.db.models.signals import m2m_changed, post_delete, post_save, pre_save
from django.http import HttpRequest
from django.utils import timezone
from django.utils.translation import gettext_lazy as _

from rehab.people.models import Clinic, User
from rehab.people.roles import RIGHTS, Right, Role, rights_of
from rehab.people.scope import Scope, ScopedModel

# What no person changes, or what time alone does.
LEFT_OUT = {"id", "created_at", "last_login", "last_seen_at", "token_hash", "epoch", "owner"}
SECRET = {"password", "pin_hash"}  # it is noted that it changed, never what it was
HIDDEN = "•••"
BEFORE = "row before the save"
M2M_ACTIONS = {"post_add": 1, "post_remove": 0, "pre_clear": 0}  # place of the keys: old, new

_tracked: list[type[Any]] = []
_request: ContextVar[HttpRequest | None] = ContextVar("request", default=None)


@dataclass(frozen=True)
class HistoryScope(Scope):
    """Changes of the own clinic's rows, of those nouns that the role may read."""

    def narrow(self, role: Role) -> Q:
        """Leave out what the role could not read where it stands."""
        return Q(noun__in=[noun for noun in RIGHTS if Right.VIEW in rights_of(role, noun)])


def nouns() -> list[tuple[str, Any]]:
    """Give the models whose history is kept, by name, with the words for one of their rows."""
    return [(model.__name__, model._meta.verbose_name) for model in _tracked]


class HistoryEntry(ScopedModel):
    """One change of one row. ``values``: for each field what it was and what it became."""

    class Kind(models.TextChoices):
        """What became of the row."""

        ADDED = "added", _("Added")
        CHANGED = "changed", _("Changed")
        DELETED = "deleted", _("Deleted")

    scope = HistoryScope(
        clinic="clinic", host=Q(clinic__isnull=True) | Q(noun__in=["Clinic", "User"])
    )

    clinic = models.ForeignKey(
        Clinic, on_delete=models.CASCADE, related_name="+", null=True, verbose_name=_("clinic")
    )
    noun = models.CharField(_("what"), max_length=32, choices=nouns)
    row = models.BigIntegerField(_("number"))
    kind = models.CharField(_("kind"), max_length=8, choices=Kind.choices)
    values = models.JSONField(_("values"), default=dict, encoder=DjangoJSONEncoder)
    by = models.ForeignKey(
        User, on_delete=models.SET_NULL, related_name="+", null=True, verbose_name=_("by")
    )
    through = models.CharField(
        _("by which program or device"),
        max_length=64,
        blank=True,
        help_text=_("The program or tablet that did it."),
    )
    at = models.DateTimeField(_("at"), default=timezone.now, db_index=True)

    class Meta(ScopedModel.Meta):
        verbose_name = _("change")
        verbose_name_plural = _("changes")
        ordering: ClassVar = ["-at", "-pk"]
        indexes: ClassVar = [models.Index(fields=["noun", "row"], name="history_by_row")]

    def __str__(self) -> str:
        return f"{self.get_noun_display()} {self.row}: {self.get_kind_display()}"


@contextmanager
def acting(request: HttpRequest) -> Iterator[None]:
    """Let whatever changes in this block be this request's doing."""
    mark = _request.set(request)
    try:
        yield
    finally:
        _request.reset(mark)


def doer() -> tuple[User | None, str]:
    """Give who acts now, and the program or tablet by which; (None, "") for the server itself."""
    request = _request.get()
    if request is None:
        return None, ""
    user = getattr(request, "auth", None) or getattr(request, "user", None)
    if isinstance(user, User):
        return user, user.program
    tablet = getattr(request, "tablet", None)
    return None, "" if tablet is None else str(tablet)[:64]


def track(*tracked: type[Any]) -> None:
    """Keep the history of these models from the start of the process on."""
    _tracked.extend(tracked)
    for model in tracked:
        pre_save.connect(_look, sender=model)
        post_save.connect(_on_save, sender=model)
        post_delete.connect(_on_delete, sender=model)
        for field in model._meta.many_to_many:
            heed = partial(_on_relation, name=field.name)
            m2m_changed.connect(heed, sender=getattr(model, field.name).through, weak=False)


def forget_values(noun: str, row: int) -> None:
    """Take the values out of a row's history; who changed which field, and when, stays."""
    for entry in HistoryEntry.everywhere.filter(noun=noun, row=row):
        entry.values = dict.fromkeys(entry.values)
        entry.save(update_fields=["values"])


def _values_of(row: Model) -> dict[str, Any]:
    return {
        field.name: getattr(row, field.attname)
        for field in row._meta.concrete_fields
        if field.name not in LEFT_OUT
    }


def _look(instance: ScopedModel, raw: bool = False, update_fields: Any = None, **_: Any) -> None:
    """Read, before a save, what is there."""
    only_quiet = update_fields is not None and LEFT_OUT.issuperset(update_fields)
    before = None
    if not (raw or only_quiet or instance.pk is None):
        before = type(instance).everywhere.filter(pk=instance.pk).first()
    vars(instance)[BEFORE] = before


def _on_save(
    instance: ScopedModel, created: bool, raw: bool = False, update_fields: Any = None, **_: Any
) -> None:
    before = vars(instance).pop(BEFORE, None)
    if raw or (before is None and not created):
        return
    old, new = _values_of(before) if before is not None else {}, _values_of(instance)
    if update_fields is not None:
        new = {name: value for name, value in new.items() if name in update_fields}
    changed = {
        name: [old.get(name), value]
        for name, value in new.items()
        if (old[name] != value if name in old else value not in (None, ""))
    }
    if created or changed:
        kinds = HistoryEntry.Kind
        _write(instance, kinds.ADDED if created else kinds.CHANGED, changed)


def _on_delete(instance: ScopedModel, **_: Any) -> None:
    values = {name: [value, None] for name, value in _values_of(instance).items()}
    _write(instance, HistoryEntry.Kind.DELETED, values)


def _on_relation(
    instance: ScopedModel, action: str, pk_set: Any, reverse: bool, name: str, **_: Any
) -> None:
    if reverse or action not in M2M_ACTIONS:
        return
    keys = getattr(instance, name).values_list("pk", flat=True) if pk_set is None else pk_set
    if keys:
        pair: list[Any] = [None, None]
        pair[M2M_ACTIONS[action]] = sorted(keys)
        _write(instance, HistoryEntry.Kind.CHANGED, {name: pair})


def _write(row: ScopedModel, kind: str, values: dict[str, list[Any]]) -> None:
    by, through = doer()
    HistoryEntry.everywhere.create(
        clinic_id=clinic_id_of(row),
        noun=type(row).__name__,
        row=row.pk,
        kind=kind,
        values={
            name: [HIDDEN if value and name in SECRET else value for value in pair]
            for name, pair in values.items()
        },
        by=by,
        through=through,
    )


def clinic_id_of(row: ScopedModel) -> int | None:
    """Give the key of the clinic that a row belongs to; None for shared rows and hosts."""
    owner: Any = row
    for step in row.scope.clinic.split("__"):
        owner = getattr(owner, step)
    key: int | None = owner.pk if isinstance(owner, Model) else owner
    return key
