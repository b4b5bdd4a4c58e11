"""Passkeys (WebAuthn): a device proves itself by a signature that is good for this site alone."""

from __future__ import annotations

import json
from datetime import datetime
from ipaddress import ip_address
from typing import Any

from django.http import HttpRequest
from django.http.request import split_domain_port
from fido2.server import Fido2Server
from fido2.utils import websafe_decode, websafe_encode
from fido2.webauthn import (
    AttestedCredentialData,
    AuthenticationResponse,
    PublicKeyCredentialRpEntity,
    PublicKeyCredentialUserEntity,
    ResidentKeyRequirement,
    UserVerificationRequirement,
)

from rehab.people.models import User
from rehab.people.sign_in.factors import Authenticator, add, authenticators_of

STATE = "passkey"  # in the browser session, until the browser has answered
VERIFICATION = UserVerificationRequirement.PREFERRED


class NotProven(ValueError):
    """An answer that proves nothing."""


def are_possible(request: HttpRequest) -> bool:
    """Whether browsers offer them here: at a name, encrypted or on the same machine."""
    name, _ = split_domain_port(request.get_host())
    try:
        ip_address(name.strip("[]"))
    except ValueError:
        return request.is_secure() or name == "localhost"
    return False


def ask_to_make(request: HttpRequest, user: User) -> str:
    """Give what the browser needs to make a passkey, as JSON."""
    entity = PublicKeyCredentialUserEntity(
        id=str(user.pk).encode(), name=user.username, display_name=str(user)
    )
    options, state = _server(request).register_begin(
        entity,
        _credentials_of(user),
        resident_key_requirement=ResidentKeyRequirement.DISCOURAGED,
        user_verification=VERIFICATION,
    )
    return _ask(request, options.public_key, state)


def ask_to_sign(request: HttpRequest, user: User) -> str:
    """Give what the browser needs to sign with one of the account's passkeys, as JSON; "" where it
    has none, or none can be used here.
    """
    credentials = _credentials_of(user)
    if not credentials or not are_possible(request):
        return ""
    options, state = _server(request).authenticate_begin(credentials, VERIFICATION)
    return _ask(request, options.public_key, state)


def keep(request: HttpRequest, user: User, name: str, answer: str) -> list[str]:
    """Keep a passkey that the browser has made. Give recovery codes, where it is the first factor.

    Raises NotProven.
    """
    try:
        made = _server(request).register_complete(_state(request), json.loads(answer))
    except Exception as problem:  # whatever is wrong with what a stranger's program sent
        raise NotProven from problem
    if made.credential_data is None:
        raise NotProven
    material = websafe_encode(made.credential_data)
    return add(user, Authenticator.Kind.PASSKEY, name, material, made.counter)


def take(request: HttpRequest, user: User, answer: str, now: datetime) -> None:
    """Take a signature by one of the account's passkeys. Raises NotProven."""
    own = {_credential(key).credential_id: key for key in _passkeys_of(user)}
    try:
        given = AuthenticationResponse.from_dict(json.loads(answer))
        _server(request).authenticate_complete(_state(request), _credentials_of(user), given)
        key = own[given.raw_id]
    except Exception as problem:  # as above
        raise NotProven from problem
    if not key.use(given.response.authenticator_data.counter, now):
        raise NotProven  # its count has stood still: a copy of the key


def _server(request: HttpRequest) -> Fido2Server:
    name, _ = split_domain_port(request.get_host())
    own = f"{request.scheme}://{request.get_host()}"
    return Fido2Server(
        PublicKeyCredentialRpEntity(id=name, name="GARRY"),
        verify_origin=lambda origin: origin == own,
    )


def _ask(request: HttpRequest, options: Any, state: Any) -> str:
    request.session[STATE] = state
    return json.dumps(dict(options))


def _state(request: HttpRequest) -> Any:
    return request.session.pop(STATE)  # an answer counts once


def _passkeys_of(user: User) -> list[Authenticator]:
    return list(authenticators_of(user).filter(kind=Authenticator.Kind.PASSKEY))


def _credential(key: Authenticator) -> AttestedCredentialData:
    return AttestedCredentialData(websafe_decode(key.material))


def _credentials_of(user: User) -> list[AttestedCredentialData]:
    return [_credential(key) for key in _passkeys_of(user)]
