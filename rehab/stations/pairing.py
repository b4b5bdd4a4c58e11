"""How a tablet comes to a station: it shows a code, and somebody who is signed in approves it."""

from __future__ import annotations

import secrets
from datetime import datetime, timedelta

from django.core.cache import cache
from django.utils.translation import gettext as _

from rehab.people.models import UNAMBIGUOUS
from rehab.people.tokens import hash_token
from rehab.stations.models import Device, Pairing, Station

LIFETIME = timedelta(minutes=5)
CODE_LENGTH = 6  # of 31 characters: one in 900 million, with ten tries in five minutes
MOST_OPEN = 500  # codes at a time on one server; a flood of strangers ends there
TRIES = 10


class PairingRefused(ValueError):
    """A pairing that cannot be; the message says what to do."""


def begin(now: datetime) -> tuple[Pairing, str]:
    """Make a code to be shown, and the secret by which the tablet is known until it is approved.

    Raises PairingRefused where too many codes are open.
    """
    Pairing.everywhere.filter(expires_at__lte=now).delete()
    if Pairing.everywhere.count() >= MOST_OPEN:
        raise PairingRefused(_("Too many tablets are being paired. Try again in five minutes."))
    secret = secrets.token_urlsafe(32)
    code = "".join(secrets.choice(UNAMBIGUOUS) for _ in range(CODE_LENGTH))
    pairing = Pairing(code=code, secret_hash=hash_token(secret), expires_at=now + LIFETIME)
    pairing.save()
    return pairing, secret


def find(secret: str, now: datetime) -> Pairing | None:
    """Give the pairing that a tablet has begun; None once it has expired."""
    begun = Pairing.everywhere.filter(secret_hash=hash_token(secret), expires_at__gt=now)
    return begun.select_related("device").first()


def approve(code: str, station: Station, by: int, now: datetime) -> Device:
    """Let the tablet that shows this code in at a station. ``by`` is who asks, to count tries.

    Raises PairingRefused.
    """
    tries = f"pairing-tries-{by}"
    cache.add(tries, 0, LIFETIME.total_seconds())
    if cache.incr(tries) > TRIES:
        raise PairingRefused(_("Too many wrong codes. Wait five minutes."))
    wanted = Pairing.everywhere.filter(
        code=code.strip().upper(), device__isnull=True, expires_at__gt=now
    )
    if not wanted.exists():
        raise PairingRefused(
            _("No tablet shows this code now. Codes last five minutes; look at the tablet again.")
        )
    count = Device.everywhere.filter(station=station, kind=Device.Kind.TABLET).count()
    device = Device(
        clinic_id=station.clinic_id,
        station=station,
        kind=Device.Kind.TABLET,
        name=_("Tablet %(number)s") % {"number": count + 1},
    )
    device.new_token()  # nobody knows it: the tablet gets its own when it comes back
    device.save()
    if not wanted.update(device=device):  # somebody else was quicker
        device.delete()
        raise PairingRefused(_("This tablet has just been paired."))
    cache.delete(tries)
    return device


def collect(pairing: Pairing) -> str | None:
    """Give an approved tablet its token, once. None where it is not approved, or had it."""
    device = pairing.device
    if device is None or device.is_revoked:
        return None
    taken, _ = Pairing.everywhere.filter(pk=pairing.pk).delete()
    if not taken:
        return None
    token = device.new_token()
    device.save()
    return token
