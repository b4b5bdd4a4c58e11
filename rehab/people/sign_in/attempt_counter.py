"""Attempts to sign in, counted in the database before each is checked.

Counting first, with the rows locked, makes attempts that are sent at once wait for each other: of a
thousand, no more are checked than the limit allows. A right password or code is taken back.
"""

from __future__ import annotations

from collections.abc import Collection
from datetime import datetime, timedelta
from typing import NamedTuple

from django.db import models, transaction
from django.db.models import F, Q
from django.utils.crypto import salted_hmac

from rehab.people.models import User
from rehab.people.scope import Scope, ScopedModel

LOCKOUT = timedelta(minutes=15)  # also the time after which failures are forgotten
KNOWN_FOR = timedelta(days=30)  # an address from which an account has signed in


class Limit(NamedTuple):
    """So many failures of one kind lock; ``name`` and ``address`` say what is counted together."""

    kind: str
    failures: int
    name: str = ""
    address: str = ""

    @property
    def key(self) -> str:
        """Return the key of its row, which reveals neither name nor address."""
        what = "\n".join((self.kind, self.name, self.address))
        return salted_hmac("garry.sign_in_attempts", what, algorithm="sha256").hexdigest()


class SignInAttempts(ScopedModel):
    """The failed attempts that one limit counts together."""

    scope = Scope(clinic="user__clinic")

    key = models.CharField(max_length=64, unique=True)
    # The account, where the name is one's: unlocking finds its rows by it.
    user = models.ForeignKey(User, on_delete=models.CASCADE, related_name="+", null=True)
    failures = models.PositiveIntegerField(default=0)
    counted_at = models.DateTimeField(db_index=True)
    locked_until = models.DateTimeField(null=True)
    signed_in_at = models.DateTimeField(null=True)

    class Meta(ScopedModel.Meta):
        pass

    def __str__(self) -> str:
        return "sign-in attempts"

    def left(self, now: datetime) -> timedelta:
        """Return how long these attempts are locked still."""
        return max(timedelta(), (self.locked_until or now) - now)


def count(limits: Collection[Limit], now: datetime) -> timedelta:
    """Count an attempt that is about to be checked.

    Return how long to wait; more than nothing means that it is not counted and must not be checked.
    """
    with transaction.atomic():
        # In one order, so that attempts which share several limits cannot wait for each other.
        rows = [(limit, _lock(limit, now)) for limit in sorted(limits, key=lambda one: one.key)]
        wait = max(row.left(now) for _, row in rows)
        if wait:
            return wait
        for limit, row in rows:
            is_old = now - row.counted_at >= LOCKOUT
            row.failures = 1 if is_old else row.failures + 1
            row.counted_at = now
            row.locked_until = now + LOCKOUT if row.failures >= limit.failures else None
            row.save()
    return wait


def take_back(limits: Collection[Limit]) -> None:
    """Take back an attempt that was right, or was not checked after all."""
    rows = _rows(limits).filter(failures__gt=0)
    rows.update(failures=F("failures") - 1, locked_until=None)


def time_to_wait(limits: Collection[Limit], now: datetime) -> timedelta:
    """Return how long these limits are locked still."""
    return max((row.left(now) for row in _rows(limits)), default=timedelta())


def forget(limits: Collection[Limit], now: datetime) -> None:
    """Forget the failures of an account that has just signed in, and know it again there."""
    _rows(limits).update(failures=0, locked_until=None, signed_in_at=now)


def forget_all(user: User) -> None:
    """Forget all failures of an account, from every address."""
    SignInAttempts.everywhere.filter(user=user).delete()


def is_known(limit: Limit, now: datetime) -> bool:
    """Return whether the name of a limit has signed in from its address lately."""
    return _rows([limit]).filter(signed_in_at__gt=now - KNOWN_FOR).exists()


def _rows(limits: Collection[Limit]) -> models.QuerySet[SignInAttempts]:
    return SignInAttempts.everywhere.filter(key__in=[limit.key for limit in limits])


def _lock(limit: Limit, now: datetime) -> SignInAttempts:
    user = User.everywhere.filter(username=limit.name).first() if limit.name else None
    locked = SignInAttempts.everywhere.select_for_update()
    row, is_new = locked.get_or_create(key=limit.key, defaults={"counted_at": now, "user": user})
    if is_new:
        _delete_old(now)
    return row


def _delete_old(now: datetime) -> None:
    is_known = Q(signed_in_at__gt=now - KNOWN_FOR)
    SignInAttempts.everywhere.filter(counted_at__lt=now - 2 * LOCKOUT).exclude(is_known).delete()
