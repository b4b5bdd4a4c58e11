"""Which rows an actor may see: the one place that separates clinics.

Every model declares how its rows belong to a clinic (`scope`) and has two managers: `objects`,
which offers `visible_to(actor)` alone, and `everywhere`, for the server's own work (the session
writer, migrations, tests), whose results are shown to nobody directly.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any, ClassVar, NoReturn, Protocol, Self, TypeVar

from django.db import models
from django.db.models import Q, QuerySet

from rehab.people.roles import Right, Role, rights_of

M = TypeVar("M", bound=models.Model)


class Member(Protocol):
    """The attributes of an account that decide which rows it sees."""

    is_active: bool
    role: str
    clinic_id: int | None


class UnscopedQuery(RuntimeError):
    """A query without an actor."""


class CrossClinicReference(ValueError):
    """A row of one clinic that refers to a row of another."""


@dataclass(frozen=True)
class Scope:
    """How a model's rows belong to a clinic.

    Attributes
    ----------
    clinic
        The lookup of the clinic.
    station
        The lookup of the station, for models that devices may see.
    shared
        Rows without a clinic belong to all clinics.
    host
        The condition on the rows that a host sees; None: no rows.
    """

    clinic: str
    station: str | None = None
    shared: bool = False
    host: Q | None = None

    def clinic_filter(self, clinic_id: int) -> Q:
        """Return the condition on the rows that a member of this clinic may see."""
        own = Q(**{self.clinic: clinic_id})
        return own | Q(**{f"{self.clinic}__isnull": True}) if self.shared else own

    def role_filter(self, role: Role) -> Q:
        """Return a further condition for a member with this role. Usually none."""
        return Q()

    def member_filter(self, user: Any) -> Q:
        """Return a further condition for one account. Usually none."""
        return Q()

    def device_filter(self, device: Any) -> Q:
        """Return a further condition for a device of the station. Usually none."""
        return Q()


def visible_rows(model: type[models.Model], actor: Any) -> Q | None:
    """Return the condition on the rows that an actor may see; None for no rows at all.

    An actor is a User or a Device. Anything else (a stranger, None) sees nothing, and so does an
    account that is inactive, without a role, or without the clinic that its role needs.
    """
    scope: Scope | None = getattr(model, "scope", None)
    if scope is None:
        return None
    kind = getattr(actor, "actor_kind", "")
    if kind == "device":
        return _visible_to_device(scope, actor)
    if kind == "user":
        return _visible_to_user(scope, actor, model.__name__)
    return None


def _visible_to_user(scope: Scope, user: Member, model_name: str) -> Q | None:
    if not user.is_active or Right.VIEW not in rights_of(user.role, model_name):
        return None
    if user.role == Role.HOST:
        return scope.host
    if not user.clinic_id:
        return None
    role = scope.role_filter(Role(user.role))
    return scope.clinic_filter(user.clinic_id) & role & scope.member_filter(user)


def _visible_to_device(scope: Scope, device: Any) -> Q | None:
    if device.is_revoked or scope.station is None:
        return None
    return Q(**{scope.station: device.station_id}) & scope.device_filter(device)


class ScopedManager(models.Manager[M]):
    """A manager that needs an actor for every query: `Patient.objects.visible_to(user)`."""

    queryset_class: type[QuerySet[Any]] = QuerySet

    def get_queryset(self) -> NoReturn:
        """Raise UnscopedQuery: a query must name who will see its rows."""
        name = self.model.__name__
        raise UnscopedQuery(
            f"Name who will see the rows: {name}.objects.visible_to(actor). "
            f"The server's own work uses {name}.everywhere."
        )

    def visible_to(self, actor: Any) -> QuerySet[M]:
        """Return the rows that this actor may see."""
        rows: QuerySet[M] = self.queryset_class(self.model, using=self._db)
        condition = visible_rows(self.model, actor)
        return rows.none() if condition is None else rows.filter(condition)


class ScopedModel(models.Model):
    """A model whose rows belong to a clinic."""

    scope: ClassVar[Scope]

    everywhere: ClassVar[models.Manager[Self]] = models.Manager()
    objects: ClassVar[ScopedManager[Self]] = ScopedManager()

    class Meta:
        abstract = True
        default_manager_name = "everywhere"
        base_manager_name = "everywhere"


class ClinicModel(ScopedModel):
    """A model with a clinic. Its rows never refer to a row of another clinic."""

    class Meta(ScopedModel.Meta):
        abstract = True

    def save(self, *args: Any, **kwargs: Any) -> None:
        """Save the row. Raises CrossClinicReference for a related row of another clinic."""
        self.check_one_clinic(kwargs.get("update_fields"))
        super().save(*args, **kwargs)

    def check_one_clinic(self, update_fields: Iterable[str] | None = None) -> None:
        """Raise CrossClinicReference for a related row of another clinic, of those to be saved."""
        saved = None if update_fields is None else set(update_fields)
        mine = getattr(self, "clinic_id", None)
        for field in self._meta.concrete_fields:
            if not field.is_relation or field.name == "clinic":
                continue
            if saved is not None and not saved & {field.name, "clinic"}:
                continue
            related = getattr(self, field.name)
            theirs = getattr(related, "clinic_id", None)
            if theirs is not None and theirs != mine:
                raise CrossClinicReference(
                    f"{self._meta.verbose_name} and its {field.verbose_name} belong to different "
                    f"clinics. Choose a {field.verbose_name} of the same clinic."
                )
