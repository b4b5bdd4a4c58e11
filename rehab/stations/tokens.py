"""Tokens of devices: whose one is, and the successor that a source or robot gets by itself.

A device that can store a token gets a successor when it first connects, and each month from then
on. It says the new one back once its disk has it, or connects by it: then the old one is no good
any more, and where it is seen again it was copied.
"""

from __future__ import annotations

from datetime import datetime, timedelta

from django.db import transaction
from django.db.models import Q

from rehab.people.audit.audit_log import Act, build_entry, record, record_counted
from rehab.people.sign_in.tokens import draw_token, find_by_token, hash_token
from rehab.stations import device_trust
from rehab.stations.models import Device

ROTATE_AFTER = timedelta(days=30)
EXPIRES_AFTER = timedelta(days=90)  # of one that was given in this way


def find_device(token: str, now: datetime, address: str = "") -> Device | None:
    """Return the device that this token belongs to; None for an unknown, revoked or expired one."""
    device = find_by_token(Device, token, now)
    hashed = hash_token(token)
    if device is None:
        rows = Device.everywhere.filter(revoked_at__isnull=True).select_related("clinic")
        # Its own, too: it may have become that since, by a connection of before.
        known = Q(token_hash=hashed) | Q(successor_hash=hashed) | Q(retired_hash=hashed)
        device = rows.filter(known).first()
    if device is None:
        return None
    device.address = address
    if device_trust.find_ended([device], now):
        device.revoked_at = now  # it does not come back with its approver's account or role
        device.save(update_fields=["revoked_at"])
        return None
    if device.token_hash == hashed:
        return None if device.has_expired(now) else device
    if device.successor_hash == hashed:
        return device if adopt_successor(device, token, address, now) else None
    _note_copy(device, address, now)
    return None


def is_successor_due(device: Device, now: datetime) -> bool:
    """Return whether a device that can store one is to get another token."""
    return not (device.builtin or device.place) and (  # one that is worn is paired for a day
        device.rotated_at is None or now - device.rotated_at >= ROTATE_AFTER
    )


def give_successor(device: Device, now: datetime) -> str:
    """Return another token of a device; the present one goes on until the other was used."""
    token = draw_token()
    device.successor_hash = device.given_hash = hash_token(token)
    Device.everywhere.filter(pk=device.pk, token_hash=device.token_hash).update(
        successor_hash=device.successor_hash
    )
    return token


def adopt_successor(device: Device, token: str, address: str, now: datetime) -> bool:
    """Make the successor that a device has used its token; return whether it is the one.

    Where a device says it back and connects by it at the same time, the second one is right, too.
    """
    hashed = hash_token(token)
    with transaction.atomic():
        rows = Device.everywhere.select_for_update(no_key=True, of=("self",))
        row = rows.get(pk=device.pk)
        if row.is_revoked:
            return False
        if row.token_hash == hashed:
            device.token_hash, device.rotated_at = hashed, row.rotated_at
            return True
        if row.successor_hash != hashed:
            return False
        record(Act.TOKEN, row, about=f"{row._meta.verbose_name}: {row}", address=address, now=now)
        changed = {
            "token_hash": hashed,
            "retired_hash": row.token_hash,
            "successor_hash": "",
            "rotated_at": now,
            "token_expires_at": now + EXPIRES_AFTER,
            "last_seen_at": now,
        }
        Device.everywhere.filter(pk=device.pk).update(**changed)
    for name, value in changed.items():
        setattr(device, name, value)
    return True


def _note_copy(device: Device, address: str, now: datetime) -> None:
    """Note that somebody has a token that its device has given up."""
    Device.everywhere.filter(pk=device.pk).update(copy_seen_at=now)
    about = f"{device._meta.verbose_name}: {device}"
    record_counted(build_entry(Act.TOKEN_COPY, device, about=about, address=address, now=now))
