"""How a tablet comes to a station: it shows a code, and somebody who is signed in approves it."""

from __future__ import annotations

import secrets
from datetime import datetime, timedelta

from django.core.cache import cache
from django.utils.translation import gettext as _

from rehab.people.models import UNAMBIGUOUS
from rehab.people.sign_in.tokens import hash_token
from rehab.stations.models import Device, Pairing, Station

LIFETIME = timedelta(minutes=5)
CODE_LENGTH = 6  # of 31 characters: one in 900 million, with ten tries in five minutes
MOST_OPEN = 500  # codes at a time on one server; a flood of strangers ends there
MOST_SHOWN = 20  # of these for one address, as a clinic's tablets may share one
MOST_BEGUN = 100  # for one address within the lifetime of a code; a tablet keeps its own
TRIES = 10


class PairingRefused(ValueError):
    """A pairing that cannot be; the message says what to do."""


class PairingFlooded(PairingRefused):
    """One address asks for more codes than tablets can show."""


def begin(address: str, now: datetime) -> tuple[Pairing, str]:
    """Make a code to be shown, and the secret by which the tablet is known until it is approved.

    A new code takes the place of the oldest one of an address that has its share of them. Raises
    PairingFlooded where that address never stops, and PairingRefused where too many are open.
    """
    Pairing.everywhere.filter(expires_at__lte=now).delete()
    if _count(f"pairing-begun-{address}") > MOST_BEGUN:
        raise PairingFlooded(
            _("Too many codes were asked for from this network. Try again in five minutes.")
        )
    shown = f"pairing-shown-{address}"
    mine = Pairing.everywhere.filter(pk__in=cache.get(shown, []), device__isnull=True)
    kept = list(mine.order_by("-pk").values_list("pk", flat=True)[: MOST_SHOWN - 1])
    mine.exclude(pk__in=kept).delete()
    if Pairing.everywhere.count() >= MOST_OPEN:
        raise PairingRefused(_("Too many tablets are being paired. Try again in five minutes."))
    secret = secrets.token_urlsafe(32)
    code = "".join(secrets.choice(UNAMBIGUOUS) for _ in range(CODE_LENGTH))
    pairing = Pairing(code=code, secret_hash=hash_token(secret), expires_at=now + LIFETIME)
    pairing.save()
    cache.set(shown, [*kept, pairing.pk], LIFETIME.total_seconds())
    return pairing, secret


def _count(name: str) -> int:
    """Count one more of something within the lifetime of a code; give how many there were."""
    cache.add(name, 0, LIFETIME.total_seconds())
    return cache.incr(name)


def find(secret: str, now: datetime) -> Pairing | None:
    """Give the pairing that a tablet has begun; None once it has expired."""
    begun = Pairing.everywhere.filter(secret_hash=hash_token(secret), expires_at__gt=now)
    return begun.select_related("device").first()


def approve(code: str, station: Station, by: int, now: datetime) -> Device:
    """Let the tablet that shows this code in at a station. ``by`` is who asks, to count tries.

    Raises PairingRefused.
    """
    tries = f"pairing-tries-{by}"
    if _count(tries) > TRIES:
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
