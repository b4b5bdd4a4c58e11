"""When a device was last there, in words."""

from __future__ import annotations

from datetime import datetime, timedelta

from django.utils.dateformat import format as format_date
from django.utils.translation import gettext, ngettext

from rehab.stations.models import Device

NOW = timedelta(minutes=2)  # a token's use is noted once a minute
NEVER_AFTER = timedelta(minutes=10)  # by then a new token should have been used


def say_seen(moment: datetime | None, now: datetime) -> str:
    """Say how long ago a moment was; beyond a day, its date by the clock of ``now``."""
    if moment is None:
        return gettext("never seen")
    ago = now - moment
    if ago < NOW:
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
    return gettext("seen on %(day)s") % {
        "day": format_date(moment.astimezone(now.tzinfo), "M j, Y")
    }


def say_state(device: Device, now: datetime) -> str:
    """Say whether a device may dial in, and when it last did."""
    if device.is_revoked:
        return gettext("revoked")
    return say_seen(device.last_seen_at, now)


def is_overdue(device: Device, now: datetime) -> bool:
    """Whether a device has a token that it has never used."""
    never = not device.builtin and not device.is_revoked and device.last_seen_at is None
    return never and now - device.created_at > NEVER_AFTER
