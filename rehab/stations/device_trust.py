"""Who may let a tablet in, and how long it is trusted: as long as the person who let it in.

What a tablet shows would tell an assessor the arm, and what its person must not see, it must not
show that person either. Sources and robots are programs without a screen, and not meant here.
"""

from __future__ import annotations

from datetime import datetime, timedelta

from django.db.models import F, Q, QuerySet
from django.utils.translation import gettext as _

from rehab.people.models import User
from rehab.people.models.blinding import assessors
from rehab.people.networks import is_in_networks
from rehab.people.roles import Role
from rehab.stations.models import Device

UNUSED_FOR = timedelta(days=30)  # an unused tablet ends then


class NotTrusted(ValueError):
    """A person or place that no tablet is let in by or from; the message says what to do."""


def approvers() -> QuerySet[User]:
    """Return the accounts that may let a tablet of their clinic in."""
    carers = User.everywhere.filter(is_active=True, role__in=[Role.LEAD, Role.PT])
    return carers.exclude(pk__in=assessors().values("pk"))


def check_approval(by: User, address: str) -> None:
    """Raise NotTrusted where a person may let no tablet in, or none that asks from an address."""
    if not approvers().filter(pk=by.pk).exists():
        raise NotTrusted(
            _(
                "You are an assessor of a running study, and what a tablet shows would tell you "
                "an arm. Ask a lead or a treating therapist to let it in."
            )
        )
    networks = by.clinic.networks if by.clinic else ""
    if networks and not is_in_networks(networks, address):
        raise NotTrusted(
            _(
                "This tablet asks from outside the clinic’s networks. Connect it to the clinic’s "
                "network and open its page again. If you do not have it before you, let nothing in."
            )
        )


def is_trusted() -> Q:
    """Return the condition on devices that are no tablets, or whose approver still may be one."""
    approved = Q(approver__in=approvers(), approver__clinic=F("clinic"))
    return ~Q(kind=Device.Kind.TABLET) | approved


def is_unused(device: Device, now: datetime) -> bool:
    """Return whether a tablet was not used for so long that it ends."""
    used_at = device.last_seen_at or device.approved_at or device.created_at
    return device.kind == Device.Kind.TABLET and now - used_at >= UNUSED_FOR


def has_ended(device: Device, now: datetime) -> bool:
    """Return whether a tablet has lost its approver or was not used for long."""
    if device.kind != Device.Kind.TABLET:
        return False
    is_valid = Device.everywhere.filter(is_trusted(), pk=device.pk).exists()
    return not is_valid or is_unused(device, now)
