"""Passkeys (WebAuthn): a device signs a challenge with a key that works for this site alone."""

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
from rehab.people.sign_in.factors.factors import Authenticator, add_authenticator, authenticators_of

CHALLENGE = "passkey"  # key of the browser session, until the browser has answered
KIND = Authenticator.Kind.PASSKEY
VERIFICATION = UserVerificationRequirement.PREFERRED


class PasskeyRejected(ValueError):
    """An answer that does not verify."""


def are_supported(request: HttpRequest) -> bool:
    """Return whether browsers offer passkeys here: at a name, over TLS or on the same machine."""
    name, _ = split_domain_port(request.get_host())
    try:
        ip_address(name.strip("[]"))
    except ValueError:
        return request.is_secure() or name == "localhost"
    return False


def registration_options(request: HttpRequest, user: User) -> str:
    """Return the options with which the browser creates a passkey, as JSON."""
    entity = PublicKeyCredentialUserEntity(
        id=str(user.pk).encode(), name=user.username, display_name=str(user)
    )
    options, state = _relying_party(request).register_begin(
        entity,
        _credentials_of(user),
        resident_key_requirement=ResidentKeyRequirement.DISCOURAGED,
        user_verification=VERIFICATION,
    )
    return _store_challenge(request, options.public_key, state)


def authentication_options(request: HttpRequest, user: User) -> str:
    """Return the options with which the browser signs with one of the account's passkeys, as JSON.

    Returns "" where the account has none, or none can be used here.
    """
    credentials = _credentials_of(user)
    if not credentials or not are_supported(request):
        return ""
    options, state = _relying_party(request).authenticate_begin(credentials, VERIFICATION)
    return _store_challenge(request, options.public_key, state)


def register(request: HttpRequest, user: User, name: str, answer: str) -> list[str]:
    """Store a passkey that the browser has created. Return the first factor's recovery codes.

    Raises PasskeyRejected.
    """
    try:
        registered = _relying_party(request).register_complete(
            _pop_challenge(request), json.loads(answer)
        )
    except Exception as problem:  # fido2 raises many types of errors for malformed answers
        raise PasskeyRejected from problem
    new = registered.credential_data
    if new is None or new.credential_id in map(_id_of, Authenticator.everywhere.filter(kind=KIND)):
        raise PasskeyRejected  # stored twice, its counter would be too (WebAuthn 3, section 7.1)
    credential = websafe_encode(new)
    return add_authenticator(user, KIND, name, credential, registered.counter)


def verify(request: HttpRequest, user: User, answer: str, now: datetime) -> None:
    """Verify a signature by one of the account's passkeys. Raises PasskeyRejected."""
    own = {_id_of(key): key for key in _passkeys_of(user)}
    try:
        response = AuthenticationResponse.from_dict(json.loads(answer))
        _relying_party(request).authenticate_complete(
            _pop_challenge(request), _credentials_of(user), response
        )
        key = own[response.raw_id]
    except Exception as problem:  # as above
        raise PasskeyRejected from problem
    if not key.record_use(response.response.authenticator_data.counter, now):
        raise PasskeyRejected  # the counter has not advanced: the key may be a copy


def _relying_party(request: HttpRequest) -> Fido2Server:
    name, _ = split_domain_port(request.get_host())
    own = f"{request.scheme}://{request.get_host()}"
    return Fido2Server(
        PublicKeyCredentialRpEntity(id=name, name="GARRY"),
        verify_origin=lambda origin: origin == own,
    )


def _store_challenge(request: HttpRequest, options: Any, state: Any) -> str:
    request.session[CHALLENGE] = state
    return json.dumps(dict(options))


def _pop_challenge(request: HttpRequest) -> Any:
    return request.session.pop(CHALLENGE)  # a challenge is answered once


def _passkeys_of(user: User) -> list[Authenticator]:
    return list(authenticators_of(user).filter(kind=KIND))


def _credential(key: Authenticator) -> AttestedCredentialData:
    return AttestedCredentialData(websafe_decode(key.credential))


def _id_of(key: Authenticator) -> bytes:
    return _credential(key).credential_id


def _credentials_of(user: User) -> list[AttestedCredentialData]:
    return [_credential(key) for key in _passkeys_of(user)]
