"""Text about when a device last connected."""

from __future__ import annotations

from collections.abc import Collection
from datetime import datetime, timedelta

from django.utils.formats import date_format
from django.utils.html import format_html
from django.utils.safestring import SafeString
from django.utils.translation import gettext, ngettext

from rehab.stations.device_trust import find_ended
from rehab.stations.models import Device

JUST_NOW = timedelta(minutes=2)  # `last_seen_at` is stored once a minute
OVERDUE_AFTER = timedelta(minutes=10)  # a new token should have been used by then


def format_last_seen(moment: datetime | None, now: datetime) -> str:
    """Return how long ago a moment was; after a day, its date in the time zone of ``now``."""
    if moment is None:
        return gettext("never seen")
    ago = now - moment
    if ago < JUST_NOW:
        return gettext("seen just now")
    if ago < timedelta(hours=1):
        minutes = round(ago.total_seconds() / 60)
        return ngettext("seen %(count)s minute ago", "seen %(count)s minutes ago", minutes) % {
            "count": minutes
        }
    if ago < timedelta(days=1):
        hours = round(ago.total_seconds() / 3600)
        return ngettext("seen %(count)s hour ago", "seen %(count)s hours ago", hours) % {
            "count": hours
        }
    return gettext("seen on %(day)s") % {"day": date_format(moment.astimezone(now.tzinfo))}


def format_device_states(devices: Collection[Device], now: datetime) -> list[tuple[Device, str]]:
    """Return devices with what is wrong with each one's token, else when it last connected."""
    ended = find_ended(devices, now)
    return [(device, _format_state(device, device.pk in ended, now)) for device in devices]


def format_device_state(device: Device, now: datetime) -> str:
    """Return what is wrong with a device's token, else when it last connected."""
    [(_, state)] = format_device_states([device], now)
    return state


def format_badge(device: Device, state: str, now: datetime) -> SafeString:
    """Return a device's state with its sign: ✓ connected, ! to be seen to, – away or shut out."""
    seen = device.last_seen_at
    if device.is_revoked or (device.builtin and seen is None):
        sign, look = "–", "free"
    elif seen is None or state != format_last_seen(seen, now):
        sign, look = "!", "warn"
    else:
        sign, look = ("✓", "") if now - seen < JUST_NOW else ("–", "free")
    return format_html('<span class="badge {}">{} {}</span>', look, sign, state)


def _format_state(device: Device, has_ended: bool, now: datetime) -> str:
    if device.is_revoked:
        return gettext("revoked")
    if has_ended:
        return gettext("expired, unused or with its approver’s rights: let it in again")
    if device.has_expired(now):
        return gettext("its token has expired: give it a new one")
    if device.copy_seen_at is not None:
        return gettext("its old token was used on %(day)s: give it a new one") % {
            "day": date_format(device.copy_seen_at.astimezone(now.tzinfo))
        }
    return format_last_seen(device.last_seen_at, now)


def is_overdue(device: Device, now: datetime) -> bool:
    """Return whether a device has a token that it has never used."""
    is_unused = not device.builtin and not device.is_revoked and device.last_seen_at is None
    return is_unused and now - device.created_at > OVERDUE_AFTER
