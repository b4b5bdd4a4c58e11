"""Who looked at patients' data, took it out, or gave a robot orders. Rows are only added.

Views are written by `AccessMiddleware` for every page and call that does not say that it shows no
patients; sockets, exports and commands write their own. What is taken out is noted before the first
byte goes. A page that asks again and again is noted once in some minutes.
"""

from __future__ import annotations

import logging
from collections import OrderedDict
from collections.abc import Hashable
from datetime import datetime, timedelta
from ipaddress import IPv4Address, ip_address, ip_network
from threading import Lock
from typing import Any, ClassVar, NoReturn

from django.db import DatabaseError, models, transaction
from django.db.models import QuerySet
from django.utils import timezone
from django.utils.translation import gettext_lazy as _

from rehab.people.audit.history import clinic_id_of
from rehab.people.models import Clinic, Patient, User
from rehab.people.scope import Scope, ScopedManager, ScopedModel

log = logging.getLogger(__name__)

AGAIN_AFTER = timedelta(minutes=5)
REMEMBERED = 10_000  # views; what is forgotten early is noted twice
SERVER = "server console"


class AppendOnly(TypeError):
    """A log's row that somebody tried to change or take away."""

    def __init__(self) -> None:
        super().__init__(
            "The audit log is only added to. What is too old goes with `manage.py retention`."
        )


class Appended(QuerySet["AuditEntry"]):
    """Rows that can be read and added."""

    def update(self, **values: Any) -> NoReturn:
        """Refuse."""
        raise AppendOnly

    def delete(self) -> NoReturn:
        """Refuse."""
        raise AppendOnly

    def bulk_update(self, *rows: Any, **options: Any) -> NoReturn:
        """Refuse."""
        raise AppendOnly


class VisibleEntries(ScopedManager["AuditEntry"]):
    """Entries by scope, to be read."""

    rows = Appended


class Act(models.TextChoices):
    """What was done."""

    VIEW = "view", _("Looked at")
    CHANGE = "change", _("Changed")
    EXPORT = "export", _("Took data out")
    BACKUP = "backup", _("Backed up")
    ERASE = "erase", _("Erased")
    UNLOCK = "unlock", _("Unlocked an account")
    FACTORS = "factors", _("Removed second factors")
    TOKEN = "token", _("Gave a new token")
    ROBOT_STOP = "robot_stop", _("Stopped the robot")
    ROBOT_ARM = "robot_arm", _("Armed the robot")
    ROBOT_TRIAL = "robot_trial", _("Tried a gesture on the robot")


class AuditEntry(ScopedModel):
    """Who did what, with whose data, when and from where."""

    scope = Scope(clinic="clinic")

    clinic = models.ForeignKey(
        Clinic, on_delete=models.PROTECT, related_name="+", verbose_name=_("clinic")
    )
    at = models.DateTimeField(_("when"), default=timezone.now)
    by = models.ForeignKey(
        User, on_delete=models.PROTECT, related_name="+", null=True, verbose_name=_("who")
    )
    through = models.CharField(_("by which program or device"), max_length=64, blank=True)
    act = models.CharField(_("what"), max_length=16, choices=Act.choices)
    # The log outlives what it tells of: a row that goes takes nothing from it.
    patient = models.ForeignKey(
        Patient,
        on_delete=models.DO_NOTHING,
        db_constraint=False,
        related_name="+",
        null=True,
        verbose_name=_("whose"),
    )
    about = models.CharField(_("where in GARRY"), max_length=200, blank=True)
    address = models.CharField(_("from"), max_length=45, blank=True)

    everywhere: ClassVar[Any] = models.Manager.from_queryset(Appended)()
    objects: ClassVar[VisibleEntries] = VisibleEntries()

    class Meta(ScopedModel.Meta):
        verbose_name = _("audit entry")
        verbose_name_plural = _("audit log")
        ordering: ClassVar = ["-at", "-pk"]
        indexes: ClassVar = [
            models.Index(fields=["clinic", "-at"], name="audit_by_clinic_and_date"),
            models.Index(fields=["patient", "-at"], name="audit_by_patient_and_date"),
        ]

    def __str__(self) -> str:
        return f"{self.get_act_display()}: {self.about}"

    def save(self, *args: Any, **kwargs: Any) -> None:
        """Add the row. Raises AppendOnly for one that is there already."""
        if not self._state.adding:
            raise AppendOnly
        super().save(*args, **kwargs)

    def delete(self, *args: Any, **kwargs: Any) -> NoReturn:
        """Refuse."""
        raise AppendOnly


class Recent:
    """What was noted a moment ago. Shared by the threads of a process."""

    def __init__(self) -> None:
        self._noted: OrderedDict[Hashable, datetime] = OrderedDict()
        self._lock = Lock()

    def is_new(self, key: Hashable, now: datetime) -> bool:
        """Whether this was not noted within some minutes; from now on it is."""
        with self._lock:
            last = self._noted.pop(key, None)
            fresh = last is None or now - last >= AGAIN_AFTER
            self._noted[key] = now if last is None or fresh else last
            while len(self._noted) > REMEMBERED:
                self._noted.popitem(last=False)
        return fresh


recent = Recent()


def compose(
    act: Act,
    actor: Any,
    *,
    patient: int | None = None,
    about: str = "",
    address: str = "",
    clinic: int | None = None,
    now: datetime,
) -> AuditEntry:
    """Give an entry. ``actor`` is a person or a device; None the server's own console, whose
    ``clinic`` has to be told.
    """
    person = actor if isinstance(actor, User) else None
    through = SERVER if actor is None else person.program if person else str(actor)
    home: Any = getattr(actor, "clinic_id", None) or clinic
    return AuditEntry(
        clinic_id=home,
        at=now,
        by=person,
        through=through[:64],
        act=act,
        patient_id=patient,
        about=about[:200],
        address=shorten(address),
    )


def note(act: Act, actor: Any, **facts: Any) -> None:
    """Add an entry. Raises DatabaseError where it cannot be kept: nothing may then be given out."""
    compose(act, actor, **facts).save()


def note_safety(act: Act, actor: User, row: Any, address: str, now: datetime) -> None:
    """Add an entry of what alters who gets in: an account's, a device's or a program's row."""
    clinic = clinic_id_of(row) or actor.clinic_id
    about = f"{row._meta.verbose_name}: {row}"
    if clinic is None:  # a host's own account: no clinic has a log of it
        log.warning("%s, %s, by %s from %s", act.label, about, actor, shorten(address))
        return
    note(act, actor, clinic=clinic, about=about, address=address, now=now)


def try_to_keep(entries: list[AuditEntry]) -> None:
    """Add entries of what has happened already. If they cannot be kept, care goes on without.

    What belongs to no clinic is left out: it is a host's, who sees no patients.
    """
    try:
        with transaction.atomic():
            AuditEntry.everywhere.bulk_create([one for one in entries if one.clinic_id])
    except DatabaseError:
        log.exception("The audit log missed: %s", ", ".join(str(one) for one in entries))


def shorten(address: str) -> str:
    """Give the network of an address: whether somebody was in the clinic, not at which machine."""
    try:
        parsed = ip_address(address)
    except ValueError:
        return ""
    bits = 24 if isinstance(parsed, IPv4Address) else 48
    return str(ip_network((parsed, bits), strict=False))


def forget_before(clinic: int, moment: datetime) -> int:
    """Let go of a clinic's entries from before a moment; give how many."""
    return _rows().filter(clinic=clinic, at__lt=moment).delete()[0]


def forget_patient(patient: int) -> None:
    """Let the entries of an erased patient lead to nobody."""
    _rows().filter(patient=patient).update(patient=None, about="")


def _rows() -> QuerySet[AuditEntry]:
    """Give rows that can be altered: only what the law asks for, and only here."""
    return QuerySet(AuditEntry)
