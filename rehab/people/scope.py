"""Which rows an actor may see: the one place that keeps clinics apart.

Every model of GARRY says how its rows belong to a clinic (`scope`), and offers two managers:
`objects`, which gives nothing but `visible_to(actor)`, and `everywhere`, for the server's own work
(the session writer, migrations, tests), where no person's eyes are involved.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar, NoReturn, Protocol, Self, TypeVar

from django.db import models
from django.db.models import Q, QuerySet

from rehab.people.roles import Right, Role, rights_of

M = TypeVar("M", bound=models.Model)


class Member(Protocol):
    """What decides which rows an account sees."""

    is_active: bool
    role: str
    clinic_id: int | None


class UnscopedQuery(RuntimeError):
    """A query that does not say for whose eyes it is."""


class CrossClinic(ValueError):
    """A row of one clinic that points to a row of another."""


@dataclass(frozen=True)
class Scope:
    """How a model's rows belong to a clinic.

    ``clinic`` is the lookup that leads to the clinic; ``station`` the one to the station, for
    models that a device may see; ``shared`` says that rows without a clinic belong to all;
    ``host`` narrows what a host sees (None: nothing); ``narrow`` what a role sees of its own
    clinic.
    """

    clinic: str
    station: str | None = None
    shared: bool = False
    host: Q | None = None

    def of_clinic(self, clinic_id: int) -> Q:
        """Give the rows that a member of this clinic may see."""
        mine = Q(**{self.clinic: clinic_id})
        return mine | Q(**{f"{self.clinic}__isnull": True}) if self.shared else mine

    def narrow(self, role: Role) -> Q:
        """Give what else must hold for a member with this role. Usually nothing."""
        return Q()


def visible(model: type[models.Model], actor: Any) -> Q | None:
    """Give the condition on the rows that an actor may see; None for no row at all.

    An actor is a User or a Device. Anything else (a stranger, None) sees nothing, and so does an
    account that is switched off, without a role, or without the clinic that its role needs.
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


def _visible_to_user(scope: Scope, user: Member, noun: str) -> Q | None:
    if not user.is_active or Right.VIEW not in rights_of(user.role, noun):
        return None
    if user.role == Role.HOST:
        return scope.host
    if not user.clinic_id:
        return None
    return scope.of_clinic(user.clinic_id) & scope.narrow(Role(user.role))


def _visible_to_device(scope: Scope, device: Any) -> Q | None:
    if device.is_revoked or scope.station is None:
        return None
    return Q(**{scope.station: device.station_id})


class ScopedManager(models.Manager[M]):
    """Gives rows only once it is told for whose eyes: `Patient.objects.visible_to(user)`."""

    rows: type[QuerySet[Any]] = QuerySet

    def get_queryset(self) -> NoReturn:
        """Refuse: a query must say who will see its rows."""
        name = self.model.__name__
        raise UnscopedQuery(
            f"Say for whose eyes this is: {name}.objects.visible_to(actor). "
            f"The server's own work uses {name}.everywhere."
        )

    def visible_to(self, actor: Any) -> QuerySet[M]:
        """Give the rows that this actor may see."""
        rows: QuerySet[M] = self.rows(self.model, using=self._db)
        condition = visible(self.model, actor)
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


class ClinicRow(ScopedModel):
    """A row that names its clinic. It never points to a row of another clinic."""

    class Meta(ScopedModel.Meta):
        abstract = True

    def save(self, *args: Any, **kwargs: Any) -> None:
        """Save the row. Raises CrossClinic where a related row belongs to another clinic."""
        self.check_one_clinic()
        super().save(*args, **kwargs)

    def check_one_clinic(self) -> None:
        """Raise CrossClinic where a related row belongs to another clinic."""
        mine = getattr(self, "clinic_id", None)
        for field in self._meta.concrete_fields:
            if not field.is_relation or field.name == "clinic":
                continue
            related = getattr(self, field.name)
            theirs = getattr(related, "clinic_id", None)
            if theirs is not None and theirs != mine:
                raise CrossClinic(
                    f"{self._meta.verbose_name} and its {field.verbose_name} belong to different "
                    f"clinics. Choose a {field.verbose_name} of the same clinic."
                )
