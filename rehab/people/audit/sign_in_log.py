"""Records sign-ins in the audit log: who came in, who failed, and what changed about coming in.

Signals of Django and of our models report it, so that no way in is forgotten. A failure for a name
that no account has goes to the server's log, without the name: it may be a password.
"""

from __future__ import annotations

import logging
from typing import Any

from django.contrib.auth.signals import user_logged_in, user_login_failed
from django.db.models.signals import post_delete, post_save
from django.http import HttpRequest
from django.utils import timezone

from rehab.people.audit import audit_log
from rehab.people.audit.audit_log import Act, AuditEntry
from rehab.people.audit.history import current_actor, current_request
from rehab.people.models import User
from rehab.people.networks import client_address

log = logging.getLogger(__name__)


def connect_receivers(authenticator: type[Any]) -> None:
    """Listen from now on; ``authenticator`` is the model of second factors."""
    user_logged_in.connect(_on_signed_in)
    user_login_failed.connect(_on_failed)
    post_save.connect(_on_account_saved, sender=User)
    post_save.connect(_on_factor_saved, sender=authenticator)
    post_delete.connect(_on_factor_deleted, sender=authenticator)


def record_token_use(user: User, request: HttpRequest) -> None:
    """Record the first call of a program from a network."""
    address = client_address(request)
    now = timezone.now()
    network = audit_log.truncate_address(address)
    if not audit_log.recent_views.is_new(("token", user.pk, user.program, network), now):
        return
    known = AuditEntry.everywhere.filter(
        by=user, act=Act.TOKEN_USE, through=user.program[:64], address=network
    )
    if not known.exists():
        _record(Act.TOKEN_USE, user, request, about=request.path)


def record_lockout(username: Any, request: HttpRequest) -> None:
    """Record that an account is locked out."""
    user = _find_account(username)
    if user is not None:
        _record(Act.LOCK_OUT, user, request)


def record_refused_factor(user: User, request: HttpRequest) -> None:
    """Record that a second factor was not added: its first code, or its passkey, was wrong."""
    _record(Act.REFUSED, user, request, about=request.path)


def _record(act: Act, user: User, request: HttpRequest | None, about: str = "") -> None:
    """Record what an account did, or what was tried with its name."""
    address = client_address(request) if request is not None else ""
    entry = audit_log.build_entry(act, user, about=about, address=address, now=timezone.now())
    audit_log.record_counted(entry)


def _on_signed_in(request: HttpRequest | None, user: Any, **_: Any) -> None:
    if request is not None and request.META:  # else no browser, but a test or a command
        _record(Act.SIGN_IN, user, request)


def _on_failed(credentials: dict[str, Any], request: HttpRequest | None = None, **_: Any) -> None:
    user = _find_account(credentials.get("username"))
    if user is not None:
        _record(Act.SIGN_IN_FAILED, user, request, about=request.path if request else "")
    elif request is not None:
        network = audit_log.truncate_address(client_address(request))
        log.info("A sign-in failed from %s, by a name that no account has", network)


def _find_account(username: Any) -> User | None:
    return User.everywhere.filter(username=str(username or "")[:150]).first()


def _on_account_saved(instance: User, created: bool, raw: bool = False, **_: Any) -> None:
    # Django has the new password there until it is stored.
    if not (created or raw) and vars(instance).get("_password") is not None:
        _record_change(Act.PASSWORD, instance, str(instance))


def _on_factor_saved(instance: Any, created: bool, raw: bool = False, **_: Any) -> None:
    if created and not raw:
        _record_change(Act.FACTOR_ADDED, instance.user, str(instance))


def _on_factor_deleted(instance: Any, **_: Any) -> None:
    _record_change(Act.FACTOR_REMOVED, instance.user, str(instance))


def _record_change(act: Act, account: User, what: str) -> None:
    """Record a change to an account by whoever makes it; fails with the change itself."""
    by, _through = current_actor()
    request = current_request()
    audit_log.record(
        act,
        by or account,
        clinic_id=account.clinic_id,
        about=what if by in (None, account) else f"{account}: {what}",
        address=client_address(request) if request is not None else "",
        now=timezone.now(),
    )
