"""Who may let a tablet or phone in, and how long it is trusted: as long as who let it in.

What a tablet shows, and a phone is told as a source, would tell an assessor the arm; what a person
must not see, their devices must not get. Other sources, and robots, have their tokens from a lead.
"""

from __future__ import annotations

from collections.abc import Iterable
from datetime import datetime, timedelta

from django.db.models import BooleanField, ExpressionWrapper, F, Q, QuerySet
from django.db.models.functions import Coalesce
from django.utils.translation import gettext as _

from rehab.people.audit.audit_log import Act, record, truncate_address
from rehab.people.models import User
from rehab.people.networks import is_outside
from rehab.people.roles import Role
from rehab.stations.models import Device

UNUSED_FOR = timedelta(days=30)  # an unused tablet ends then


class NotTrusted(ValueError):
    """A person or place that no device is let in by or from; the message says what to do."""


def approvers() -> QuerySet[User]:
    """Return the accounts that may let a tablet or phone of their clinic in."""
    carers = User.everywhere.filter(is_active=True, role__in=[Role.LEAD, Role.PT])
    return carers.exclude(pk__in=User.everywhere.assessors().values("pk"))


def check_approval(by: User, address: str, device: str, now: datetime) -> None:
    """Raise NotTrusted where a person may let no device in, or none that asks from an address.

    The audit log has what was refused, with the words for the device.
    """
    if not approvers().filter(pk=by.pk).exists():
        refusal = _(
            "You are an assessor of a running study, and what a tablet or phone gets would tell "
            "you an arm. Ask a lead or a treating therapist to let it in."
        )
    elif is_outside(by.clinic.networks if by.clinic else "", address):
        refusal = _(
            "This device asks from outside the clinic’s networks. Connect it to the clinic’s "
            "network and open its page again. If you do not have it before you, let nothing in."
        )
    else:
        return
    record(Act.REFUSED, by, about=f"{device}: {truncate_address(address)}", now=now)
    raise NotTrusted(refusal)


def is_trusted() -> Q:
    """Return the condition on devices that nobody let in, or whose approver still may do so."""
    let_in = Q(kind=Device.Kind.TABLET) | ~Q(place="") | Q(approver__isnull=False)
    return ~let_in | Q(approver__in=approvers(), approver__clinic=F("clinic"))


def with_trust(devices: QuerySet[Device]) -> QuerySet[Device]:
    """Return devices that know whether they are trusted, so that a list of them asks once."""
    condition = ExpressionWrapper(is_trusted(), BooleanField())
    return devices.annotate(is_trusted=Coalesce(condition, False))  # type: ignore[no-redef]


def find_ended(devices: Iterable[Device], now: datetime) -> set[int]:
    """Return the keys of those let in that have lost their approver or were unused for long."""
    let_in = {device.pk: device for device in devices if device.is_let_in}
    trusted = {pk for pk, device in let_in.items() if device.is_trusted}
    if unknown := [pk for pk, device in let_in.items() if device.is_trusted is None]:
        known = Device.everywhere.filter(is_trusted(), pk__in=unknown)
        trusted |= set(known.values_list("pk", flat=True))

    def used_at(device: Device) -> datetime:
        return device.last_seen_at or device.approved_at or device.created_at

    return {
        pk
        for pk, device in let_in.items()
        if pk not in trusted or now - used_at(device) >= UNUSED_FOR
    }
