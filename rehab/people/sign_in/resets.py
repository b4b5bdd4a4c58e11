"""Resets by hosts: a second person confirms before a host gives somebody a new way to sign in.

A host sees no patient, and could become anybody who does by a new password or by taking a second
factor away. So the account's owner or another host has to agree, once for each reset.
"""

from __future__ import annotations

from datetime import datetime, timedelta
from typing import ClassVar

from django.db import models
from django.db.models import Q

from rehab.people.models import User
from rehab.people.roles import Role
from rehab.people.scope import Scope, ScopedModel

ASKED_FOR = timedelta(hours=24)  # how long a request waits to be confirmed
CONFIRMED_FOR = timedelta(hours=1)  # how long the host then has


class ResetRequest(ScopedModel):
    """A host who asks to reset how an account signs in."""

    scope = Scope(clinic="account__clinic")

    account = models.ForeignKey(User, on_delete=models.CASCADE, related_name="+")
    asked_by = models.ForeignKey(User, on_delete=models.CASCADE, related_name="+")
    asked_at = models.DateTimeField()
    confirmed_by = models.ForeignKey(User, on_delete=models.CASCADE, related_name="+", null=True)
    confirmed_at = models.DateTimeField(null=True)

    class Meta(ScopedModel.Meta):
        constraints: ClassVar = [
            models.UniqueConstraint(
                fields=["account", "asked_by"], name="reset_request_once_per_host"
            )
        ]

    def __str__(self) -> str:
        return f"reset of {self.account} by {self.asked_by}"


def needs_confirmation(by: User, account: User) -> bool:
    """Return whether a second person has to confirm that ``by`` resets an account."""
    return by.role == Role.HOST and account.pk != by.pk


def may_reset(by: User, account: User, now: datetime) -> bool:
    """Return whether ``by`` may reset an account now; where not, ask for it.

    A host's confirmed request is used up by this.
    """
    if not needs_confirmation(by, account):
        return True
    mine = ResetRequest.everywhere.filter(account=account, asked_by=by)
    used, _ = mine.filter(confirmed_at__gt=now - CONFIRMED_FOR).delete()
    if used:
        return True
    ResetRequest.everywhere.update_or_create(
        account=account,
        asked_by=by,
        defaults={"asked_at": now, "confirmed_by": None, "confirmed_at": None},
    )
    return False


def requests_for(confirmer: User, now: datetime) -> models.QuerySet[ResetRequest]:
    """Return the requests that a person can confirm: of the own account; as a host, of any."""
    mine = Q() if confirmer.role == Role.HOST else Q(account=confirmer)
    waiting = ResetRequest.everywhere.filter(mine, confirmed_at=None, asked_at__gt=now - ASKED_FOR)
    return waiting.exclude(asked_by=confirmer).select_related("account", "asked_by")


def confirm_request(confirmer: User, request_id: int, now: datetime) -> ResetRequest | None:
    """Confirm a request; return None where there is none that this person can confirm."""
    request = requests_for(confirmer, now).filter(pk=request_id).first()
    if request is not None:
        request.confirmed_by, request.confirmed_at = confirmer, now
        request.save()
    return request
