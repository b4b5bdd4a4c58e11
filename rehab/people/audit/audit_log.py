"""The audit log: who looked at or exported patients' data, commanded a robot, or signed in.

`AccessMiddleware` records views of every page and API call that is not declared to show no
patients; sockets, exports, commands and `sign_in_log` record their own. An export is recorded
before its first byte is sent. A page that reloads is recorded once in some minutes.
"""

from __future__ import annotations

import logging
from collections import OrderedDict
from collections.abc import Hashable
from datetime import datetime, timedelta
from ipaddress import IPv4Address, ip_address, ip_network
from threading import Lock
from typing import Any, ClassVar, NoReturn

from django.db import Error, IntegrityError, models, transaction
from django.db.models import F, Q, QuerySet
from django.utils import timezone
from django.utils.translation import gettext_lazy as _

from rehab.people.audit.history import clinic_id_of
from rehab.people.audit.sealing import SealableModel
from rehab.people.models import Clinic, Patient, User
from rehab.people.policy import erased_by, personal_fields, retained
from rehab.people.scope import Scope, ScopedManager

log = logging.getLogger(__name__)

REPEAT_AFTER = timedelta(minutes=5)
MAX_RECENT = 10_000  # views; beyond that some are recorded twice
SERVER = "server console"


class AppendOnlyViolation(TypeError):
    """An attempt to change or delete a row of the log."""

    def __init__(self) -> None:
        super().__init__(
            "The audit log is append-only. `manage.py retention` deletes what is too old."
        )


class AppendOnlyQuerySet(QuerySet["AuditEntry"]):
    """A queryset that can read and add rows."""

    def update(self, **values: Any) -> NoReturn:
        """Raise AppendOnlyViolation."""
        raise AppendOnlyViolation

    def delete(self) -> NoReturn:
        """Raise AppendOnlyViolation."""
        raise AppendOnlyViolation

    def bulk_update(self, *rows: Any, **options: Any) -> NoReturn:
        """Raise AppendOnlyViolation."""
        raise AppendOnlyViolation

    def bulk_create(self, objs: Any, *args: Any, **options: Any) -> Any:
        """Add rows with their digests."""
        entries = list(objs)
        for entry in entries:
            entry.set_digest()
        return super().bulk_create(entries, *args, **options)


class ScopedEntryManager(ScopedManager["AuditEntry"]):
    """Entries by scope, append-only."""

    queryset_class = AppendOnlyQuerySet


class Act(models.TextChoices):
    """What was done."""

    VIEW = "view", _("Looked at")
    CHANGE = "change", _("Changed")
    EXPORT = "export", _("Took data out")
    BACKUP = "backup", _("Backed up")
    ERASE = "erase", _("Erased")
    UNLOCK = "unlock", _("Unlocked an account")
    FACTORS = "factors", _("Removed second factors")
    RESET = "reset", _("Confirmed a host's reset")
    SIGN_IN = "sign_in", _("Signed in")
    SIGN_IN_FAILED = "sign_in_failed", _("Failed to sign in")
    LOCK_OUT = "lock_out", _("Was locked out")
    SIGN_INS_ENDED = "sign_ins_ended", _("Ended all sign-ins")
    FACTOR_ADDED = "factor_added", _("Added a second factor")
    FACTOR_REMOVED = "factor_removed", _("Removed a second factor")
    RECOVERY_CODES = "recovery_codes", _("Made new recovery codes")
    PASSWORD = "password", _("Changed a password")
    TOKEN_USE = "token_use", _("Used a token from a new network")
    REFUSED = "refused", _("Was refused")
    TOKEN = "token", _("Gave a new token")
    TOKEN_COPY = "token_copy", _("Used a token that was replaced")
    FAMILY_LINK = "family_link", _("Gave a family a link")
    FAMILY_END = "family_end", _("Ended a family's link")
    FAMILY_VIEW = "family_view", _("Looked at, by a family's link")
    UNBLIND = "unblind", _("Revealed a study's arm")
    ROBOT_STOP = "robot_stop", _("Stopped the robot")
    ROBOT_ARM = "robot_arm", _("Armed the robot")
    ROBOT_TRIAL = "robot_trial", _("Tried a gesture on the robot")


# What an account's own page of sign-ins tells.
SIGN_IN_ACTS = (
    *(Act.SIGN_IN, Act.SIGN_IN_FAILED, Act.LOCK_OUT, Act.SIGN_INS_ENDED, Act.PASSWORD),
    *(Act.FACTOR_ADDED, Act.FACTOR_REMOVED, Act.RECOVERY_CODES, Act.TOKEN_USE, Act.REFUSED),
)


def anonymize_patient(patient: Patient, _pseudonym: str) -> None:
    """Remove an erased patient from the entries; their digests stay."""
    emptied = {"patient": None, "about": "", "salt": "", "erased": True}
    _mutable_rows().filter(patient=patient).update(**emptied)


def _mutable_rows() -> QuerySet[AuditEntry]:
    """Return rows that can be changed: for repeats and erasure, and only in this module."""
    return QuerySet(AuditEntry)


class AuditEntry(SealableModel):
    """Who did what, with whose data, when and from where. ``count``: how often in some minutes."""

    scope = Scope(clinic="clinic", host=Q(clinic__isnull=True))
    sealed_fields = ("clinic", "at", "by", "through", "act", "patient", "about", "address")

    # None: what hosts do, who have no clinic.
    clinic = models.ForeignKey(
        Clinic, on_delete=models.PROTECT, related_name="+", null=True, verbose_name=_("clinic")
    )
    at = models.DateTimeField(_("when"), default=timezone.now)
    by = models.ForeignKey(
        User, on_delete=models.PROTECT, related_name="+", null=True, verbose_name=_("who")
    )
    through = models.CharField(_("by which program or device"), max_length=64, blank=True)
    act = models.CharField(_("what"), max_length=16, choices=Act.choices)
    # The log outlives the rows it refers to.
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
    count = models.PositiveIntegerField(_("times"), default=1)

    everywhere: ClassVar[Any] = models.Manager.from_queryset(AppendOnlyQuerySet)()
    objects: ClassVar[ScopedEntryManager] = ScopedEntryManager()

    personal = personal_fields(
        {
            "patient about salt erased": erased_by(anonymize_patient, shown=False, research=False),
            "clinic digest at by through act address count": retained(
                "says that staff saw something, no longer of whom", shown=False, research=False
            ),
        }
    )

    class Meta(SealableModel.Meta):
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
        """Add the row. Raises AppendOnlyViolation for a stored one."""
        if not self._state.adding:
            raise AppendOnlyViolation
        super().save(*args, **kwargs)

    def delete(self, *args: Any, **kwargs: Any) -> NoReturn:
        """Raise AppendOnlyViolation."""
        raise AppendOnlyViolation


class RecentViews:
    """The views that were recorded in the last minutes. Shared by the threads of a process."""

    def __init__(self) -> None:
        self._recorded: OrderedDict[Hashable, datetime] = OrderedDict()
        self._lock = Lock()

    def is_new(self, key: Hashable, now: datetime) -> bool:
        """Return whether a view was not recorded in the last minutes, and remember it."""
        with self._lock:
            last = self._recorded.pop(key, None)
            is_new = last is None or now - last >= REPEAT_AFTER
            self._recorded[key] = now if last is None or is_new else last
            while len(self._recorded) > MAX_RECENT:
                self._recorded.popitem(last=False)
        return is_new


recent_views = RecentViews()


class RecentEntries:
    """The counted entries of the last minutes. Shared by the threads of a process."""

    def __init__(self) -> None:
        self._keys: OrderedDict[Hashable, tuple[datetime, int]] = OrderedDict()
        self._lock = Lock()

    def find(self, key: Hashable, now: datetime) -> int | None:
        """Return the entry that was added for the same in the last minutes; None without one."""
        with self._lock:
            at, entry_id = self._keys.get(key, (None, None))
        return entry_id if at is not None and abs(now - at) < REPEAT_AFTER else None

    def add(self, key: Hashable, now: datetime, entry_id: int) -> None:
        """Remember an entry, whose repeats are counted for some minutes."""
        with self._lock:
            self._keys[key] = now, entry_id
            while len(self._keys) > MAX_RECENT:
                self._keys.popitem(last=False)


recent_entries = RecentEntries()


def build_entry(
    act: Act,
    actor: Any,
    *,
    patient_id: int | None = None,
    about: str = "",
    address: str = "",
    clinic_id: int | None = None,
    now: datetime,
) -> AuditEntry:
    """Return an entry, not saved. ``actor`` is a person or a device.

    Without an actor it is the server's console, which needs a ``clinic_id``.
    """
    person = actor if isinstance(actor, User) else None
    through = SERVER if actor is None else person.program if person else str(actor)
    entry_clinic_id: Any = clinic_id or getattr(actor, "clinic_id", None)
    return AuditEntry(
        clinic_id=entry_clinic_id,
        at=now,
        by=person,
        through=through[:64],
        act=act,
        patient_id=patient_id,
        about=about[:200],
        address=truncate_address(address),
    )


def record(act: Act, actor: Any, **details: Any) -> None:
    """Add an entry. Raises DatabaseError on failure: then nothing may be exported."""
    build_entry(act, actor, **details).save()


def record_security_change(act: Act, actor: User, row: Any, address: str, now: datetime) -> None:
    """Add an entry about a change to who has access: of an account, a device or an API token."""
    about = f"{row._meta.verbose_name}: {row}"
    record(act, actor, clinic_id=clinic_id_of(row), about=about, address=address, now=now)


def record_after_the_fact(entries: list[AuditEntry]) -> None:
    """Add entries about what has happened already. A failure is logged: care must go on."""
    try:
        with transaction.atomic():
            AuditEntry.everywhere.bulk_create(entries)
    except Error:
        log.exception("The audit log missed: %s", ", ".join(str(entry) for entry in entries))


def record_counted(entry: AuditEntry) -> None:
    """Add or count an entry about what has happened already. A failure is logged, likewise."""
    try:
        with transaction.atomic():
            add_or_count(entry)
    except Error:
        log.exception("The audit log missed: %s", entry)


def add_or_count(entry: AuditEntry) -> None:
    """Add an entry about what has happened; the same again in some minutes is only counted."""
    names = ("clinic_id", "by_id", "through", "address", "act", "patient_id", "about")
    same = {name: getattr(entry, name) for name in names}
    key = tuple(same.values())
    added_id = recent_entries.find(key, entry.at)
    # Another row has its key where the one that is remembered was rolled back.
    if added_id is None or not _count(_mutable_rows().filter(pk=added_id, **same), entry.count):
        entry.save()
        recent_entries.add(key, entry.at, entry.pk)


def _count(rows: QuerySet[AuditEntry], times: int) -> bool:
    """Count an entry's repeats in it. Return whether there is one that is not sealed yet."""
    try:
        with transaction.atomic():
            return bool(rows.update(count=F("count") + times))
    except IntegrityError:  # the database's own refusal: a clock was set back
        return False


def truncate_address(address: str) -> str:
    """Return the network of an address: it identifies a clinic, but no single machine."""
    try:
        parsed = ip_address(address)
    except ValueError:
        return ""
    bits = 24 if isinstance(parsed, IPv4Address) else 48
    return str(ip_network((parsed, bits), strict=False))
