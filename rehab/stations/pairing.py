"""Pairing of a tablet with a station: it shows a code, and a signed-in person approves it.

A phone on which a recording is tried is let in alike.
"""

from __future__ import annotations

import secrets
from datetime import datetime, timedelta

from django.core.cache import cache
from django.db import transaction
from django.utils.translation import gettext as _

from rehab.people.audit.audit_log import Act, record, truncate_address
from rehab.people.models import User
from rehab.people.random_codes import random_code
from rehab.people.row_values import read_values, save_changes
from rehab.people.sign_in.known_browsers import is_known_network
from rehab.people.sign_in.tokens import hash_token
from rehab.people.token_buckets import TokenBuckets
from rehab.stations.builtin import builtin_device
from rehab.stations.device_trust import check_approval
from rehab.stations.models import Device, Pairing, Station

LIFETIME = timedelta(minutes=5)
CODE_LENGTH = 6  # of 31 characters: one in 900 million, with ten attempts in five minutes
MAX_PENDING = 500  # codes at a time on one server, against floods from many addresses
MAX_PENDING_KNOWN = 1000  # with those of networks where somebody has signed in lately
MAX_PENDING_PER_ADDRESS = 20  # a clinic's tablets may share an address
MAX_STARTED_PER_ADDRESS = 100  # within the lifetime of a code; a tablet keeps its own
MAX_ATTEMPTS = 10
starts = TokenBuckets(MAX_STARTED_PER_ADDRESS, LIFETIME.total_seconds() / MAX_STARTED_PER_ADDRESS)
attempts = TokenBuckets(MAX_ATTEMPTS, LIFETIME.total_seconds() / MAX_ATTEMPTS)  # of an approver


class PairingRefused(ValueError):
    """A pairing that is not possible; the message says what to do."""


class PairingRateLimited(PairingRefused):
    """An address has started more pairings than its tablets can need."""


def start_pairing(address: str, now: datetime, browser: str = "") -> tuple[Pairing, str]:
    """Start a pairing. Return it, and the secret that identifies the tablet until its approval.

    The oldest pairing of an address with too many pending ones is removed. Raises
    PairingRateLimited where an address starts too many, PairingRefused where the server has too
    many pending: strangers, however many their addresses, leave room for the clinics' networks.
    """
    Pairing.everywhere.filter(expires_at__lte=now).delete()
    if starts.take(address, now.timestamp()):
        raise PairingRateLimited(
            _("Too many codes were asked for from this network. Try again in five minutes.")
        )
    pending = f"pairing-pending-{address}"
    own = Pairing.everywhere.filter(pk__in=cache.get(pending, []), device__isnull=True)
    kept = list(own.order_by("-pk").values_list("pk", flat=True)[: MAX_PENDING_PER_ADDRESS - 1])
    own.exclude(pk__in=kept).delete()
    count = Pairing.everywhere.count()
    is_full = count >= MAX_PENDING and not is_known_network(address, now)
    if is_full or count >= MAX_PENDING_KNOWN:
        raise PairingRefused(
            _(
                "Too many tablets are being paired. Sign in on any device in this network first, "
                "or try again in five minutes."
            )
        )
    secret = secrets.token_urlsafe(32)
    code = random_code(CODE_LENGTH)
    pairing = Pairing.everywhere.create(
        code=code,
        secret_hash=hash_token(secret),
        expires_at=now + LIFETIME,
        address=address,
        browser=browser[:32],
    )
    cache.set(pending, [*kept, pairing.pk], LIFETIME.total_seconds())
    return pairing, secret


def find_pairing(secret: str, now: datetime) -> Pairing | None:
    """Return the pairing that a tablet has started; None once it has expired."""
    started = Pairing.everywhere.filter(secret_hash=hash_token(secret), expires_at__gt=now)
    return started.select_related("device").first()


def find_by_code(code: str, by: User, now: datetime) -> Pairing:
    """Return the pairing of the tablet that shows a code, for a person who may let it in.

    Attempts count per person. Raises PairingRefused, and NotTrusted, which the audit log has.
    """
    if attempts.take(by.pk, now.timestamp()):
        raise PairingRefused(_("Too many wrong codes. Wait five minutes."))
    waiting = Pairing.everywhere.filter(device__isnull=True, expires_at__gt=now)
    pairing = waiting.filter(code=code.strip().upper()).first()
    if pairing is None:
        raise PairingRefused(
            _("No tablet shows this code now. Codes last five minutes; look at the tablet again.")
        )
    check_approval(by, pairing.address, f"tablet {pairing.browser}".rstrip(), now)
    return pairing


def approve_pairing(
    pairing: Pairing,
    station: Station,
    by: User,
    address: str,
    now: datetime,
    kind: Device.Kind = Device.Kind.TABLET,
) -> Device:
    """Pair what waits (`find_by_code`) with a station, by a person at an address.

    A source is the station's built-in one: the one before is left out. Raises PairingRefused.
    """
    if kind == Device.Kind.TABLET:
        count = Device.everywhere.filter(station=station, kind=kind).count()
        name = _("Tablet %(number)s") % {"number": count + 1}
        device = Device(clinic_id=station.clinic_id, station=station, kind=kind, name=name)
    else:
        device = builtin_device(station, kind, by)
    device.approver, device.approved_at = by, now
    device.network, device.browser = truncate_address(pairing.address), pairing.browser
    device.new_token()  # never shown: the device claims its own when it asks again
    with transaction.atomic():
        device.save()
        # It has the whole time again to claim its token.
        waiting = Pairing.everywhere.filter(pk=pairing.pk, device__isnull=True, expires_at__gt=now)
        if not waiting.update(device=device, expires_at=now + LIFETIME):
            raise PairingRefused(_("This tablet has just been paired."))
        about = f"{device}, {station}: {device.network} {device.browser}"
        record(Act.TABLET_IN, by, about=about, address=address, now=now)
    attempts.forget(by.pk)
    return device


def claim_token(pairing: Pairing) -> str | None:
    """Return the token of an approved tablet, once; None without approval or the second time."""
    device = pairing.device
    if device is None or device.is_revoked or device.approver_id is None:
        return None
    deleted, _ = Pairing.everywhere.filter(pk=pairing.pk).delete()
    if not deleted:  # another request claimed it
        return None
    before = read_values(device)
    token = device.new_token()
    save_changes(device, before)  # not that it is valid: somebody may revoke it at this moment
    return token
