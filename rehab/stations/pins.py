"""The PIN to leave the patient's page: set for a station, checked here alone.

Wrong PINs are counted for each screen, so that attempts at one tablet lock no other one. Only
leaving is locked: a session goes on, and can be paused and ended.
"""

from __future__ import annotations

from datetime import datetime, timedelta

from django.contrib.auth.hashers import check_password, make_password
from django.utils.translation import gettext as _

from rehab.stations.models import PinAttempts, Station

MIN_LENGTH, MAX_LENGTH = 4, 8
FREE_ATTEMPTS = 3  # fewer failures than these lock nothing: fingers slip
FIRST_LOCKOUT = timedelta(seconds=30)  # each further one lasts twice as long
LONGEST_LOCKOUT = timedelta(hours=1)


class PinRefused(ValueError):
    """A PIN that is not accepted; the message says what to do, ``wait_s`` how long to wait."""

    def __init__(self, message: str, wait_s: int = 0) -> None:
        super().__init__(message)
        self.wait_s = wait_s


def set_pin(station: Station, pin: str) -> None:
    """Set the PIN of a station, "" for none; the row is not saved. Raises ValueError."""
    if pin and not (pin.isascii() and pin.isdigit() and MIN_LENGTH <= len(pin) <= MAX_LENGTH):
        raise ValueError(_("A PIN has four to eight digits and nothing else."))
    station.pin_hash = make_password(pin) if pin else ""


def check_pin(station: Station, screen: str, pin: str, now: datetime) -> None:
    """Check a PIN; any is right where none is set. Raises PinRefused.

    An attempt is counted before it is checked, so that simultaneous ones count as one.
    """
    if not station.pin_hash:
        return
    attempts, _new = PinAttempts.everywhere.get_or_create(
        station=station, screen=screen, defaults={"locked_until": now}
    )
    if attempts.locked_until > now:
        raise _lockout_error(attempts.locked_until - now)
    lockout = lockout_after(attempts.failures + 1)
    unchanged = PinAttempts.everywhere.filter(pk=attempts.pk, failures=attempts.failures)
    counted = unchanged.update(failures=attempts.failures + 1, locked_until=now + lockout)
    if not counted:  # there was another attempt meanwhile
        raise _lockout_error(timedelta(seconds=1))
    if check_password(pin, station.pin_hash):
        PinAttempts.everywhere.filter(pk=attempts.pk).delete()
    elif lockout:
        raise _lockout_error(lockout)
    else:
        raise PinRefused(_("This is not the PIN."))


def lockout_after(failures: int) -> timedelta:
    """Return how long a screen is locked after so many wrong PINs in a row."""
    if failures < FREE_ATTEMPTS:
        return timedelta()
    return min(FIRST_LOCKOUT * (1 << min(failures - FREE_ATTEMPTS, 20)), LONGEST_LOCKOUT)


def _lockout_error(left: timedelta) -> PinRefused:
    """Return the error that says how long a screen is still locked."""
    seconds = max(1, round(left.total_seconds()))
    if seconds < 60:
        words = _("Wrong PIN. Wait %(count)s s.") % {"count": seconds}
    else:
        words = _("Wrong PIN. Wait %(count)s min.") % {"count": -(-seconds // 60)}
    return PinRefused(words, seconds)
