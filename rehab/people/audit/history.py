"""The change history of people and settings: who changed what and when, old and new values.

One table for all models. django-simple-history was considered: it queries `Model.objects` (ours
refuses), opens a version before it checks the clinic, and keeps whole copies of patients in a dozen
tables that an erasure would have to search.
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

from rehab.people.append_only import Allowed
from rehab.people.audit.moves import Translate, translate_json
from rehab.people.audit.row_digests import ERASED, SealableModel, is_cut, plain
from rehab.people.field_policy import policies_of
from rehab.people.models import Clinic, User
from rehab.people.roles import RIGHTS, Right, Role, rights_of
from rehab.people.scope import Scope, ScopedModel

# Fields that no person changes, or that change with time alone.
UNTRACKED_FIELDS = {
    "id",
    "created_at",
    "last_login",
    "last_seen_at",
    "sign_in_generation",
    "token_hash",
    "successor_hash",
    "retired_hash",
    "rotated_at",
    "token_expires_at",
    "copy_seen_at",
}
# That they changed is recorded, never their values.
SECRET_FIELDS = {"password", "pin_hash", "secret"}
MASK = "•••"
ROW_BEFORE = "_row_before_save"
M2M_ACTIONS = {"post_add": 1, "post_remove": 0, "pre_clear": 0}  # index of the keys in [old, new]

# By an erasure: the values of a change are all null.
_VALUES = {
    "sqlite": "json_each(NEW.changes) WHERE type <> 'null'",
    "postgresql": "jsonb_each(NEW.changes) WHERE value <> 'null'::jsonb",
}
EMPTIED = {
    vendor: f"{ERASED} AND NOT EXISTS (SELECT 1 FROM {values})"  # noqa: S608  # no stranger's text
    for vendor, values in _VALUES.items()
}

_tracked: list[type[Any]] = []
_request: ContextVar[HttpRequest | None] = ContextVar("request", default=None)


@dataclass(frozen=True)
class HistoryScope(Scope):
    """Changes of the own clinic's rows, of the models that the role may read."""

    def role_filter(self, role: Role) -> Q:
        """Return the condition that the role may read the model."""
        readable = [name for name in RIGHTS if Right.VIEW in rights_of(role, name)]
        return Q(model_name__in=readable)


def model_choices() -> list[tuple[str, Any]]:
    """Return the tracked models as choices: name and verbose name."""
    return [(model.__name__, model._meta.verbose_name) for model in _tracked]


class HistoryEntry(SealableModel):
    """One change of one row. ``changes``: for each field its old and its new value."""

    class Kind(models.TextChoices):
        """The kind of change."""

        ADDED = "added", _("Added")
        CHANGED = "changed", _("Changed")
        DELETED = "deleted", _("Deleted")

    scope = HistoryScope(
        clinic="clinic", host=Q(clinic__isnull=True) | Q(model_name__in=["Clinic", "User"])
    )

    allowed_changes = (Allowed(("changes", "salt", "erased"), EMPTIED),)
    allowed_deletion = is_cut("HistoryEntry")
    sealed_fields = ("clinic", "model_name", "object_id", "kind", "changes", "by", "through", "at")

    clinic = models.ForeignKey(
        Clinic, on_delete=models.CASCADE, related_name="+", null=True, verbose_name=_("clinic")
    )
    model_name = models.CharField(_("what"), max_length=32, choices=model_choices)
    object_id = models.BigIntegerField(_("number"))
    kind = models.CharField(_("kind"), max_length=8, choices=Kind.choices)
    changes = models.JSONField(_("values"), default=dict, encoder=DjangoJSONEncoder)
    by = models.ForeignKey(
        User, on_delete=models.PROTECT, related_name="+", null=True, verbose_name=_("by")
    )
    through = models.CharField(
        _("by which program or device"),
        max_length=64,
        blank=True,
        help_text=_("The program or tablet that did it."),
    )
    at = models.DateTimeField(_("at"), default=timezone.now, db_index=True)

    class Meta(SealableModel.Meta):
        verbose_name = _("change")
        verbose_name_plural = _("changes")
        ordering: ClassVar = ["-at", "-pk"]
        indexes: ClassVar = [
            models.Index(fields=["model_name", "object_id"], name="history_by_row")
        ]

    def __str__(self) -> str:
        return f"{self.get_model_name_display()} {self.object_id}: {self.get_kind_display()}"

    @property
    def is_emptied(self) -> bool:
        """Whether it has no values."""
        return not any(self.changes.values())

    def sealed_values(self, original: Translate) -> dict[str, Any]:
        """Return the sealed values by name, also those within the changes by their first keys."""
        number, changes = translate_entry(self.model_name, self.object_id, self.changes, original)
        values = super().sealed_values(original)
        return values | {"object_id": number, "changes": plain(changes)}


def translate_entry(
    model_name: str, number: int, changes: dict[str, Any], translate: Translate
) -> tuple[int, dict[str, Any]]:
    """Return an entry's row and changes with the keys in them translated."""
    model = next((one for one in _tracked if one.__name__ == model_name), None)
    if model is None:
        return number, changes
    relations = {
        field.name: field.related_model
        for field in (*model._meta.concrete_fields, *model._meta.many_to_many)
        if field.is_relation
    }
    translated = {
        name: translate_json(pair, partial(translate, relations[name]))
        if name in relations
        else pair
        for name, pair in changes.items()
    }
    return translate(model, number), translated


@contextmanager
def attribute_changes_to(request: HttpRequest) -> Iterator[None]:
    """Attribute all changes in this block to the actor of this request."""
    token = _request.set(request)
    try:
        yield
    finally:
        _request.reset(token)


def current_request() -> HttpRequest | None:
    """Return the request that is answered now; None for the server's own work."""
    return _request.get()


def current_actor() -> tuple[User | None, str]:
    """Return who acts now, and through which program or tablet; (None, "") for the server."""
    request = _request.get()
    if request is None:
        return None, ""
    user = getattr(request, "auth", None) or getattr(request, "user", None)
    if isinstance(user, User):
        return user, user.program
    tablet = getattr(request, "tablet", None)
    return None, "" if tablet is None else str(tablet)[:64]


def track_models(*tracked: type[Any]) -> None:
    """Record the changes of these models from now on."""
    _tracked.extend(tracked)
    for model in tracked:
        pre_save.connect(_read_before_save, sender=model)
        post_save.connect(_on_save, sender=model)
        post_delete.connect(_on_delete, sender=model)
        for field in model._meta.many_to_many:
            receiver = partial(_on_relation, name=field.name)
            m2m_changed.connect(receiver, sender=getattr(model, field.name).through, weak=False)


def erase_values(model_name: str, object_id: int) -> None:
    """Remove the values from a row's history; who changed which field, and when, stays.

    So does the digest, without the salt that would help to guess what it was made of.
    """
    for entry in HistoryEntry.everywhere.filter(model_name=model_name, object_id=object_id):
        entry.changes, entry.salt, entry.erased = dict.fromkeys(entry.changes), "", True
        entry.save(update_fields=["changes", "salt", "erased"])


def _values_of(row: Model) -> dict[str, Any]:
    return {
        field.name: getattr(row, field.attname)
        for field in row._meta.concrete_fields
        if _is_recorded(type(row), field.name)
    }


def _is_recorded(model: type[Model], name: str) -> bool:
    """Return whether a field's changes are recorded: by its policy, where it is a patient's."""
    policy = policies_of(model).get(name)
    return name not in UNTRACKED_FIELDS if policy is None else policy.history


def _read_before_save(
    instance: ScopedModel, raw: bool = False, update_fields: Any = None, **_: Any
) -> None:
    """Read the stored row before a save."""
    model, before = type(instance), None
    is_recorded = update_fields is None or any(_is_recorded(model, name) for name in update_fields)
    if is_recorded and not raw and instance.pk is not None:
        before = model.everywhere.filter(pk=instance.pk).first()
    vars(instance)[ROW_BEFORE] = before


def _on_save(
    instance: ScopedModel, created: bool, raw: bool = False, update_fields: Any = None, **_: Any
) -> None:
    before = vars(instance).pop(ROW_BEFORE, None)
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
        _add_entry(instance, kinds.ADDED if created else kinds.CHANGED, changed)


def _on_delete(instance: ScopedModel, **_: Any) -> None:
    changes = {name: [value, None] for name, value in _values_of(instance).items()}
    _add_entry(instance, HistoryEntry.Kind.DELETED, changes)


def _on_relation(
    instance: ScopedModel, action: str, pk_set: Any, reverse: bool, name: str, **_: Any
) -> None:
    if reverse or action not in M2M_ACTIONS:
        return
    keys = getattr(instance, name).values_list("pk", flat=True) if pk_set is None else pk_set
    if keys:
        pair: list[Any] = [None, None]
        pair[M2M_ACTIONS[action]] = sorted(keys)
        _add_entry(instance, HistoryEntry.Kind.CHANGED, {name: pair})


def _add_entry(row: ScopedModel, kind: str, changes: dict[str, list[Any]]) -> None:
    by, through = current_actor()
    HistoryEntry.everywhere.create(
        clinic_id=clinic_id_of(row),
        model_name=type(row).__name__,
        object_id=row.pk,
        kind=kind,
        changes={
            name: [MASK if value and name in SECRET_FIELDS else value for value in pair]
            for name, pair in changes.items()
        },
        by=by,
        through=through,
    )


def clinic_id_of(row: ScopedModel) -> int | None:
    """Return the key of the clinic that a row belongs to; None for shared rows and hosts."""
    owner: Any = row
    for step in row.scope.clinic.split("__"):
        owner = getattr(owner, step)
    key: int | None = owner.pk if isinstance(owner, Model) else owner
    return key
