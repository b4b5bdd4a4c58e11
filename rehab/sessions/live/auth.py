"""Authentication of sockets, and what each client may open."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from datetime import datetime
from io import BytesIO
from typing import Any
from urllib.parse import urlsplit

from channels.db import database_sync_to_async
from django.conf import settings
from django.contrib.auth import get_user
from django.contrib.sessions.models import Session
from django.core.exceptions import DisallowedHost
from django.core.handlers.asgi import ASGIRequest
from django.http import HttpRequest, parse_cookie
from django.utils import timezone
from django.utils.module_loading import import_string

from rehab.people.consent.services import is_remote_view_allowed
from rehab.people.models import Patient, User
from rehab.people.networks import is_outside, resolve_client_address
from rehab.people.sign_in import sign_in_expiry
from rehab.people.sign_in.tokens import LAST_SEEN_RESOLUTION
from rehab.people.sign_in.two_stage_sign_in import is_session_valid
from rehab.sessions.models import TrainingSession, find_newest
from rehab.stations import tablets
from rehab.stations.device_trust import is_trusted
from rehab.stations.models import Device
from rehab.stations.tablets import find_tablet
from rehab.stations.tokens import adopt_successor, find_device, give_successor, is_successor_due
from rehab.training.changes import ENDED_STATES, OPEN_STATES

Actor = User | Device | None


def socket_headers(scope: Mapping[str, Any]) -> dict[str, str]:
    """Return a socket's headers by their lower-case names."""
    return {
        name.decode("latin-1").lower(): value.decode("latin-1") for name, value in scope["headers"]
    }


def bearer_token(scope: Mapping[str, Any]) -> str | None:
    """Return the device token in the Authorization header."""
    kind, _, token = socket_headers(scope).get("authorization", "").partition(" ")
    return token.strip() if kind.lower() == "bearer" and token else None


def is_own_origin(scope: Mapping[str, Any]) -> bool:
    """Return whether a page of this server opened the socket; else its cookies are ignored.

    The page has the scheme, host and port that the socket itself was asked for by.
    """
    scheme = "https" if scope.get("scheme") in ("wss", "https") else "http"
    request = {**scope, "method": "GET", "query_string": b"", "scheme": scheme}
    try:
        page = _split_origin(socket_headers(scope).get("origin", ""))
        own = _split_origin(ASGIRequest(request, BytesIO()).build_absolute_uri("/"))
    except (ValueError, DisallowedHost):
        return False
    return page == own


def _split_origin(url: str) -> tuple[str, str, int]:
    """Return scheme, host and port of an address. Raises ValueError for what has none."""
    parts = urlsplit(url)
    default = {"http": 80, "https": 443}.get(parts.scheme)
    if default is None or not parts.hostname:
        raise ValueError(f"{url!r} is no page's address.")
    return parts.scheme, parts.hostname, parts.port or default


@database_sync_to_async
def authenticate(scope: Mapping[str, Any]) -> Actor:
    """Return the device or person that a socket belongs to; None for a stranger."""
    token = bearer_token(scope)
    if token is not None:
        return find_device(token, timezone.now(), socket_address(scope))
    if not is_own_origin(scope):
        return None
    return _signed_in(scope) or find_tablet(
        socket_cookies(scope).get(tablets.COOKIE), timezone.now(), socket_address(scope)
    )


@database_sync_to_async
def authenticate_token(token: str, scope: Mapping[str, Any]) -> Device | None:
    """Return the device of a token from a first frame; None for an unknown one."""
    if not token.isascii():
        return None
    return find_device(token, timezone.now(), socket_address(scope))


@database_sync_to_async
def offer_successor(device: Device, now: datetime) -> str | None:
    """Return a device's next token; None where it is not time for another one."""
    return give_successor(device, now) if is_successor_due(device, now) else None


@database_sync_to_async
def take_successor(device: Device, token: str, scope: Mapping[str, Any], now: datetime) -> bool:
    """Make the token that a device has stored its own; return whether it was given that one."""
    return token.isascii() and adopt_successor(device, token, socket_address(scope), now)


def socket_cookies(scope: Mapping[str, Any]) -> dict[str, str]:
    """Return a socket's cookies."""
    return parse_cookie(socket_headers(scope).get("cookie", ""))


def browser_session_key(scope: Mapping[str, Any]) -> str | None:
    """Return the key of the browser session that a socket's cookies name."""
    return socket_cookies(scope).get(settings.SESSION_COOKIE_NAME)


def browser_session_digest(scope: Mapping[str, Any]) -> str:
    """Return the digest under which a socket's browser session is stored."""
    return sign_in_expiry.digest_of(browser_session_key(scope) or "")


def _signed_in(scope: Mapping[str, Any]) -> User | None:
    request = HttpRequest()
    key = browser_session_key(scope)
    if key is None:
        return None
    store = import_string(f"{settings.SESSION_ENGINE}.SessionStore")
    request.session = store(key)
    user = get_user(request)
    return user if isinstance(user, User) and is_session_valid(request.session, user) else None


@database_sync_to_async
def find_unauthorized(
    clients: Sequence[tuple[Actor, Mapping[str, Any]]], now: datetime
) -> list[int]:
    """Return the indexes of clients, given with their scopes, that are no longer authorized.

    These are devices whose token was revoked or renewed, tablets whose approver may let none in any
    more or whose session is not theirs to show any more, people whose sign-in has ended, and who
    comes to be outside the clinic's networks without the patient's consent to remote view.
    """
    devices = {actor.pk for actor, _ in clients if isinstance(actor, Device)}
    people = {actor.pk for actor, _ in clients if isinstance(actor, User)}
    digests = {browser_session_digest(scope) for actor, scope in clients if isinstance(actor, User)}
    valid = Device.everywhere.filter(is_trusted(), pk__in=devices, revoked_at__isnull=True)
    rows = valid.select_related("clinic").in_bulk()
    accounts = User.everywhere.select_related("clinic").in_bulk(people)
    live = Session.objects.filter(session_key__in=digests, expire_date__gt=now)
    signed_in = {row.session_key: row.get_decoded() for row in live}
    watched = {_session_id(scope) for actor, scope in clients if isinstance(actor, Device)}
    ended = TrainingSession.everywhere.filter(
        pk__in=watched, state__in=[state.value for state in ENDED_STATES]
    )
    ended_ids = set(ended.values_list("pk", flat=True))

    def is_allowed(actor: Actor, scope: Mapping[str, Any]) -> bool:
        shown = _session_id(scope)
        if isinstance(actor, Device):
            row = rows.get(actor.pk)
            # The one that this client was given may just have become its device's own.
            if row is None or row.token_hash not in {actor.token_hash, actor.given_hash}:
                return False
            actor.clinic = row.clinic
            is_asked = shown in ended_ids or (shown and actor.is_away)
            return not is_asked or _is_visible(actor, shown)
        if actor is None:
            return True
        account, data = accounts.get(actor.pk), signed_in.get(browser_session_digest(scope))
        if account is None or data is None or not is_session_valid(data, account):
            return False
        return not shown or _may_watch(account, shown, scope)

    return [index for index, one in enumerate(clients) if not is_allowed(*one)]


@database_sync_to_async
def note_heard(device_ids: Collection[int], now: datetime) -> None:
    """Store that these devices are connected, at most once a minute each."""
    due = now - LAST_SEEN_RESOLUTION
    Device.everywhere.filter(pk__in=device_ids, last_seen_at__lt=due).update(last_seen_at=now)


def _session_id(scope: Mapping[str, Any]) -> int:
    """Return the session of a page's socket; 0 for a source's or robot's."""
    session_id: int = scope["url_route"]["kwargs"].get("session_id", 0)
    return session_id


@database_sync_to_async
def extend_sign_ins(scopes: Sequence[Mapping[str, Any]], now: datetime) -> None:
    """Extend the sign-ins of these sockets, whose pages show a running session."""
    keys = {key for scope in scopes if (key := browser_session_key(scope))}
    sign_in_expiry.extend_sessions(keys, now)


@database_sync_to_async
def may_open(actor: Actor, session_id: int) -> bool:
    """Return whether the actor may see the session."""
    return _is_visible(actor, session_id)


def _is_visible(actor: Actor, session_id: int) -> bool:
    return TrainingSession.objects.visible_to(actor).filter(pk=session_id).exists()


def socket_address(scope: Mapping[str, Any]) -> str:
    """Return the address that a socket comes from."""
    forwarded = socket_headers(scope).get("x-forwarded-for", "")
    return resolve_client_address(forwarded, (scope.get("client") or [""])[0])


@database_sync_to_async
def may_watch(actor: Actor, session_id: int, scope: Mapping[str, Any]) -> bool:
    """Return whether a person may watch from a socket's address; `may_open` asks for a device."""
    return not isinstance(actor, User) or _may_watch(actor, session_id, scope)


def _may_watch(user: User, session_id: int, scope: Mapping[str, Any]) -> bool:
    address = socket_address(scope)
    if user.clinic is None or not is_outside(user.clinic.networks, address):
        return True
    patients = Patient.everywhere.filter(sessions=session_id).select_related("clinic")
    return is_remote_view_allowed(patients.get(), address)


@database_sync_to_async
def find_open_session(device: Device, session_id: int | None) -> int | None:
    """Return the open session of a device's station: the newest, or the given one if open."""
    sessions = TrainingSession.objects.visible_to(device).filter(
        state__in=[state.value for state in OPEN_STATES]
    )
    if session_id is not None:
        sessions = sessions.filter(pk=session_id)
    return find_newest(sessions)
