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
from threading import RLock
from typing import Any, ClassVar

from django.db import Error, IntegrityError, models, transaction
from django.db.models import F, Q, QuerySet
from django.http import HttpRequest
from django.utils import timezone
from django.utils.translation import gettext_lazy as _

from rehab.people.append_only import Allowed
from rehab.people.audit.history import clinic_id_of
from rehab.people.audit.row_digests import ERASED, SealableModel, has_seal, is_cut
from rehab.people.field_policy import erased_by, personal_fields, retained
from rehab.people.models import Clinic, Patient, User
from rehab.people.networks import client_address
from rehab.people.scope import Scope

log = logging.getLogger(__name__)

REPEAT_AFTER = timedelta(minutes=5)
MAX_RECENT = 10_000  # views; beyond that some are recorded twice
SERVER = "server console"
IS_SEALED = "s.last_id >= OLD.id"


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
    SIGN_ON = "sign_on", _("Linked or unlinked a hospital account")
    TOKEN_USE = "token_use", _("Used a token from a new network")
    REFUSED = "refused", _("Was refused")
    TOKEN = "token", _("Gave a new token")
    TABLET_IN = "tablet_in", _("Let a tablet in")
    TOKEN_COPY = "token_copy", _("Used a token that was replaced")
    FAMILY_LINK = "family_link", _("Gave a family a link")
    FAMILY_END = "family_end", _("Ended a family's link")
    FAMILY_VIEW = "family_view", _("Looked at, by a family's link")
    UNBLIND = "unblind", _("Revealed a study's arm")
    CLINIC_IN = "clinic_in", _("Took the clinic in")
    CLINIC_OUT = "clinic_out", _("Removed a clinic")
    ROBOT_STOP = "robot_stop", _("Stopped the robot")
    ROBOT_ARM = "robot_arm", _("Armed the robot")
    ROBOT_TRIAL = "robot_trial", _("Tried a gesture on the robot")


# What an account's own page of sign-ins lists.
SIGN_IN_ACTS = (
    *(Act.SIGN_IN, Act.SIGN_IN_FAILED, Act.LOCK_OUT, Act.SIGN_INS_ENDED, Act.PASSWORD),
    *(Act.FACTOR_ADDED, Act.FACTOR_REMOVED, Act.RECOVERY_CODES, Act.TOKEN_USE, Act.REFUSED),
    Act.SIGN_ON,
)


def anonymize_patient(patient: Patient, _pseudonym: str) -> None:
    """Remove an erased patient from the entries; their digests stay."""
    emptied = {"patient": None, "about": "", "salt": "", "erased": True}
    AuditEntry.everywhere.filter(patient=patient).update(**emptied)


class AuditEntry(SealableModel):
    """Who did what, with whose data, when and from where. ``count``: how often in some minutes."""

    scope = Scope(clinic="clinic", host=Q(clinic__isnull=True))
    allowed_changes = (
        Allowed(("count",), f"NEW.count > OLD.count AND NOT {has_seal('AuditEntry', IS_SEALED)}"),
        Allowed(
            ("patient", "about", "salt", "erased"),
            f"{ERASED} AND NEW.patient_id IS NULL AND NEW.about = ''",
        ),
    )
    allowed_deletion = is_cut("AuditEntry")
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
    address = models.CharField(_("network address"), max_length=45, blank=True)
    count = models.PositiveIntegerField(_("times"), default=1)

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

    @property
    def is_emptied(self) -> bool:
        """Whether it names nobody and no place."""
        return self.patient_id is None and not self.about


class Recent:
    """The entries of the last minutes, by what they are about. Shared by a process's threads."""

    def __init__(self) -> None:
        self._entries: OrderedDict[Hashable, tuple[datetime, int]] = OrderedDict()
        self._lock = RLock()

    def find(self, key: Hashable, now: datetime) -> int | None:
        """Return the entry that was added for the same in the last minutes; None without one."""
        with self._lock:
            at, entry_id = self._entries.get(key, (None, None))
        return entry_id if at is not None and abs(now - at) < REPEAT_AFTER else None

    def add(self, key: Hashable, now: datetime, entry_id: int = 0) -> None:
        """Remember an entry for some minutes."""
        with self._lock:
            self._entries[key] = now, entry_id
            self._entries.move_to_end(key)
            while len(self._entries) > MAX_RECENT:
                self._entries.popitem(last=False)

    def is_new(self, key: Hashable, now: datetime) -> bool:
        """Return whether there was no entry in the last minutes, and remember that there is."""
        with self._lock:
            if self.find(key, now) is not None:
                return False
            self.add(key, now)
            return True


recent_views, recent_entries = Recent(), Recent()


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


def record_security_change(act: Act, request: HttpRequest, row: Any, now: datetime) -> None:
    """Add an entry about a change to who has access: of an account, a device or an API token."""
    about, address = f"{row._meta.verbose_name}: {row}", client_address(request)
    record(act, request.user, clinic_id=clinic_id_of(row), about=about, address=address, now=now)


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
    if added_id is None or not _count(
        AuditEntry.everywhere.filter(pk=added_id, **same), entry.count
    ):
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
