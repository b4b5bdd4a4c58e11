"""The PIN that lets somebody out of the patient's page: set for a station, checked here alone.

Wrong PINs are counted for each screen, so that nobody at one tablet shuts out another one, and
only leaving waits: whatever walks goes on, and pause and end stay where they are.
"""

from __future__ import annotations

from datetime import datetime, timedelta

from django.contrib.auth.hashers import check_password, make_password
from django.utils.translation import gettext as _

from rehab.stations.models import LeaveTries, Station

SHORTEST, LONGEST = 4, 8
FREE_TRIES = 3  # a slip of the finger costs nothing
FIRST_WAIT = timedelta(seconds=30)  # after that, twice as long each time
LONGEST_WAIT = timedelta(hours=1)


class PinRefused(ValueError):
    """A PIN that does not open; the message says what to do."""

    def __init__(self, message: str, wait_s: int = 0) -> None:
        super().__init__(message)
        self.wait_s = wait_s


def set_pin(station: Station, pin: str) -> None:
    """Give a station another PIN, or none (""); the row is not saved. Raises ValueError."""
    if pin and not (pin.isascii() and pin.isdigit() and SHORTEST <= len(pin) <= LONGEST):
        raise ValueError(_("A PIN has four to eight digits and nothing else."))
    station.pin_hash = make_password(pin) if pin else ""


def check_pin(station: Station, who: str, pin: str, now: datetime) -> None:
    """Return where this PIN opens, or none is set. Raises PinRefused.

    A try is counted before it is looked at: many at the same moment are no more than one.
    """
    if not station.pin_hash:
        return
    tries, _new = LeaveTries.everywhere.get_or_create(
        station=station, who=who, defaults={"open_at": now}
    )
    if tries.open_at > now:
        raise _wait(tries.open_at - now)
    wait = wait_after(tries.wrong + 1)
    counted = LeaveTries.everywhere.filter(pk=tries.pk, wrong=tries.wrong).update(
        wrong=tries.wrong + 1, open_at=now + wait
    )
    if not counted:  # another try came between
        raise _wait(timedelta(seconds=1))
    if check_password(pin, station.pin_hash):
        LeaveTries.everywhere.filter(pk=tries.pk).delete()
    elif wait:
        raise _wait(wait)
    else:
        raise PinRefused(_("This is not the PIN."))


def wait_after(wrong: int) -> timedelta:
    """Give how long a screen waits after so many wrong PINs in a row."""
    if wrong < FREE_TRIES:
        return timedelta()
    return min(FIRST_WAIT * (1 << min(wrong - FREE_TRIES, 20)), LONGEST_WAIT)


def _wait(left: timedelta) -> PinRefused:
    seconds = max(1, round(left.total_seconds()))
    if seconds < 60:
        words = _("Wrong PIN. Wait %(count)s seconds.") % {"count": seconds}
    else:
        words = _("Wrong PIN. Wait %(count)s minutes.") % {"count": -(-seconds // 60)}
    return PinRefused(words, seconds)
