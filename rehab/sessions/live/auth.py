"""Who is at the other end of a socket, and what they may open."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from datetime import datetime
from typing import Any
from urllib.parse import urlsplit

from channels.db import database_sync_to_async
from django.conf import settings
from django.contrib.auth import get_user
from django.contrib.sessions.models import Session
from django.http import HttpRequest, parse_cookie
from django.http.request import split_domain_port, validate_host
from django.utils import timezone
from django.utils.module_loading import import_string

from rehab.people.consent.services import is_remote_view_allowed
from rehab.people.models import Patient, User
from rehab.people.networks import resolve_client_address
from rehab.people.sign_in import browser_sessions
from rehab.people.sign_in.flow import is_session_valid
from rehab.sessions.models import TrainingSession
from rehab.stations import tablets
from rehab.stations.models import Device, find_device
from rehab.stations.tablets import find_tablet
from rehab.training.changes import OPEN_STATES

Actor = User | Device | None


def headers_of(scope: Mapping[str, Any]) -> dict[str, str]:
    """Give a socket's headers by their lower-case names."""
    return {
        name.decode("latin-1").lower(): value.decode("latin-1") for name, value in scope["headers"]
    }


def token_of(scope: Mapping[str, Any]) -> str | None:
    """Give the device token in the Authorization header."""
    kind, _, token = headers_of(scope).get("authorization", "").partition(" ")
    return token.strip() if kind.lower() == "bearer" and token else None


def is_own_page(scope: Mapping[str, Any]) -> bool:
    """Say whether a page of ours opened this socket: only then do its cookies count."""
    try:
        place = urlsplit(headers_of(scope).get("origin", "")).netloc
    except ValueError:
        return False
    host, _ = split_domain_port(place)
    return bool(host) and validate_host(host, settings.ALLOWED_HOSTS)


@database_sync_to_async
def find_actor(scope: Mapping[str, Any]) -> Actor:
    """Give the device or person at the other end; None for a stranger."""
    token = token_of(scope)
    if token is not None:
        return find_device(token, timezone.now())
    if not is_own_page(scope):
        return None
    return _signed_in(scope) or find_tablet(cookies_of(scope).get(tablets.COOKIE), timezone.now())


@database_sync_to_async
def find_device_by(token: str) -> Device | None:
    """Give the device that a token in a first frame belongs to."""
    return find_device(token, timezone.now()) if token.isascii() else None


def cookies_of(scope: Mapping[str, Any]) -> dict[str, str]:
    """Give a socket's cookies."""
    return parse_cookie(headers_of(scope).get("cookie", ""))


def session_key_of(scope: Mapping[str, Any]) -> str | None:
    """Give the key of the browser session that a socket's cookies name."""
    return cookies_of(scope).get(settings.SESSION_COOKIE_NAME)


def _signed_in(scope: Mapping[str, Any]) -> User | None:
    request = HttpRequest()
    key = session_key_of(scope)
    if key is None:
        return None
    store = import_string(f"{settings.SESSION_ENGINE}.SessionStore")
    request.session = store(key)
    user = get_user(request)
    return user if isinstance(user, User) and is_session_valid(request.session, user) else None


@database_sync_to_async
def find_unwelcome(admitted: Sequence[tuple[Actor, Mapping[str, Any]]], now: datetime) -> list[int]:
    """Say which of these actors, each with its socket's scope, would no longer be let in: devices
    whose token was revoked or renewed, people whose sign-in has ended or no longer holds.
    """
    devices = {actor.pk for actor, _ in admitted if isinstance(actor, Device)}
    people = {actor.pk for actor, _ in admitted if isinstance(actor, User)}
    keys = {session_key_of(scope) for actor, scope in admitted if isinstance(actor, User)}
    valid = Device.everywhere.filter(pk__in=devices, revoked_at__isnull=True)
    hashes = dict(valid.values_list("pk", "token_hash"))
    accounts = User.everywhere.select_related("clinic").in_bulk(people)
    live = Session.objects.filter(session_key__in=keys, expire_date__gt=now)
    signed_in = {row.session_key: row.get_decoded() for row in live}

    def is_welcome(actor: Actor, scope: Mapping[str, Any]) -> bool:
        if isinstance(actor, Device):
            return hashes.get(actor.pk) == actor.token_hash
        if actor is None:
            return True
        account, data = accounts.get(actor.pk), signed_in.get(session_key_of(scope) or "")
        return account is not None and data is not None and is_session_valid(data, account)

    return [index for index, one in enumerate(admitted) if not is_welcome(*one)]


@database_sync_to_async
def keep_signed_in(scopes: Sequence[Mapping[str, Any]], now: datetime) -> None:
    """Put off the end of the sign-ins by which these sockets came in: a training runs there."""
    keys = {key for scope in scopes if (key := session_key_of(scope))}
    browser_sessions.extend_sessions(keys, now)


@database_sync_to_async
def may_open(actor: Actor, session_id: int) -> bool:
    """Say whether the session is one that this actor sees."""
    return TrainingSession.objects.visible_to(actor).filter(pk=session_id).exists()


def address_of(scope: Mapping[str, Any]) -> str:
    """Give the address that a socket comes from."""
    forwarded = headers_of(scope).get("x-forwarded-for", "")
    return resolve_client_address(forwarded, (scope.get("client") or [""])[0])


@database_sync_to_async
def may_watch(actor: Actor, session_id: int, scope: Mapping[str, Any]) -> bool:
    """Say whether a person may watch from there; a device stands where it stands."""
    if not isinstance(actor, User):
        return True
    patients = Patient.everywhere.filter(sessions=session_id).select_related("clinic")
    return is_remote_view_allowed(patients.get(), address_of(scope))


@database_sync_to_async
def open_session_of(device: Device, session_id: int | None) -> int | None:
    """Give the station's open session (the newest one, or the one that is named)."""
    sessions = TrainingSession.objects.visible_to(device).filter(
        state__in=[state.value for state in OPEN_STATES]
    )
    if session_id is not None:
        sessions = sessions.filter(pk=session_id)
    return sessions.order_by("-created_at", "-pk").values_list("pk", flat=True).first()
