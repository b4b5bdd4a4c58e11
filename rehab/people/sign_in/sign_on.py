"""Sign-on with the hospital's own accounts: OpenID Connect, authorization code flow with PKCE.

Authlib checks state, nonce, signature, issuer, audience and times of what comes back
(OpenID Connect Core 1.0, 3.1.3.7); here stands whose account it is, and what it may do. An account
is found by the subject that the hospital gives it, never by a name or an address of mail, which
another person may get one day.
"""

from __future__ import annotations

from collections.abc import Mapping
from datetime import datetime
from functools import cache
from typing import Any

from authlib.integrations.base_client.errors import OAuthError
from authlib.integrations.django_client import OAuth
from django.conf import settings
from django.core.exceptions import ValidationError
from django.db import transaction
from django.http import HttpRequest, HttpResponse
from django.utils.translation import gettext as _
from joserfc import jwt
from joserfc.errors import JoseError
from joserfc.jwk import KeySet
from requests import RequestException

from rehab.people.models import Clinic, SignOnGroup, User
from rehab.people.roles import Role

WAIT_S = 5.0
CLOCK_ERROR_S = 60.0  # between this computer and the hospital's
LOGOUT_EVENT = "http://schemas.openid.net/event/backchannel-logout"  # Back-Channel Logout 1.0, 2.4
ALGORITHMS = ["RS256", "RS384", "RS512", "PS256", "PS384", "PS512", "ES256", "ES384", "ES512"]
STRONGEST_FIRST = (Role.LEAD, Role.PT, Role.RESEARCHER, Role.SPONSOR)
# Keys of the browser session.
PURPOSE = "sign_on"
ID_TOKEN = "sign_on_token"  # noqa: S105  # asked for at the sign-out


class SignOnRefused(Exception):
    """A sign-on that does not count; the message is for the person."""


def is_configured() -> bool:
    """Return whether this server knows a hospital's sign-on."""
    return bool(settings.OIDC_ISSUER)


def button_text() -> str:
    """Return what the button of the hospital's sign-on says; "" where there is none."""
    return settings.OIDC_NAME if is_configured() else ""


@cache
def client(kind: str = "") -> Any:
    """Return Authlib's client of the hospital's sign-on; it asks for its addresses when used.

    That of a ``launch`` has those of the health record.
    """
    issuer, scope = settings.OIDC_ISSUER.rstrip("/"), settings.OIDC_SCOPE
    metadata_url = f"{issuer}/.well-known/openid-configuration"
    if kind == "launch":
        metadata_url = f"{settings.SMART_FHIR}/.well-known/smart-configuration"
        scope = settings.SMART_SCOPE
    return OAuth().register(
        kind or "hospital",
        client_id=settings.OIDC_CLIENT_ID,
        client_secret=settings.OIDC_CLIENT_SECRET,
        server_metadata_url=metadata_url,
        client_kwargs={
            "scope": scope,
            "code_challenge_method": "S256",
            "default_timeout": WAIT_S,
        },
    )


def begin(
    request: HttpRequest, kind: str, next_url: str, return_url: str, now: datetime
) -> HttpResponse:
    """Return the way to the hospital's sign-on.

    ``kind`` is ``sign-in``, ``link`` (the signed-in account gets the hospital's), ``confirm`` (the
    person has to sign in there anew) or ``launch`` (the health record has a patient open). Raises
    SignOnRefused where it does not answer.
    """
    request.session[PURPOSE] = {"kind": kind, "next_url": next_url, "at": now.timestamp()}
    more: dict[str, Any] = {}
    if kind == "confirm":
        more = {"prompt": "login", "max_age": 0}
    elif kind == "launch":  # SMART App Launch 2.2.0, 2.0.9
        more = {"launch": request.GET.get("launch", ""), "aud": settings.SMART_FHIR}
    try:
        redirect: HttpResponse = _client_for(kind).authorize_redirect(request, return_url, **more)
    except (OAuthError, RequestException, RuntimeError, ValueError) as error:
        raise SignOnRefused(_("The hospital’s sign-on does not answer. Try again.")) from error
    return redirect


def _client_for(kind: str) -> Any:
    return client("launch") if kind == "launch" else client()


def complete(request: HttpRequest) -> tuple[dict[str, Any], dict[str, Any], dict[str, Any]]:
    """Return for what a sign-on was begun, the claims that it came back with, and its token.

    Raises SignOnRefused where it is none of this browser, or was refused there.
    """
    purpose = request.session.pop(PURPOSE, None)
    try:
        if purpose is None:
            raise OAuthError("no_purpose")
        token = _client_for(purpose["kind"]).authorize_access_token(request)
        claims = dict(token["userinfo"])
        hospital = client().load_server_metadata()
        if claims["iss"] != hospital["issuer"]:  # subjects are of this issuer
            raise OAuthError("other_issuer")
        if settings.OIDC_GROUPS_CLAIM not in claims and hospital.get("userinfo_endpoint"):
            more = client().userinfo(token=token)
            if more.get("sub") == claims["sub"]:  # Core 5.3.2: else it may be another's
                claims = {**more, **claims}
    except (OAuthError, JoseError, RequestException, KeyError, ValueError) as error:
        raise SignOnRefused(_("The hospital’s sign-on was not completed. Try again.")) from error
    request.session[ID_TOKEN] = token["id_token"]
    return purpose, claims, token


def has_second_factor(claims: Mapping[str, Any]) -> bool:
    """Return whether the hospital says that a second factor was shown (acr, or RFC 8176's amr)."""
    methods = claims.get("amr") or []
    return claims.get("acr") in settings.OIDC_MFA_ACR or "mfa" in methods


def was_shown_since(claims: Mapping[str, Any], begun_at_s: float) -> bool:
    """Return whether the person has signed in at the hospital since then (Core, 2: auth_time)."""
    shown_at = claims.get("auth_time")
    return isinstance(shown_at, int) and shown_at >= begun_at_s - CLOCK_ERROR_S


def find_account(claims: Mapping[str, Any]) -> User:
    """Return the account of a person who signed on, with the role that the groups give.

    Without groups in the admin, roles are what this server's leads made them. Raises SignOnRefused
    for an account that is not linked, is switched off, must not have the role, or is in no group
    any more; that one's sign-ins end.
    """
    accounts = User.everywhere.select_related("clinic")
    user = accounts.filter(subject=claims["sub"]).first()
    groups = groups_of(claims)
    if user is None:
        if settings.OIDC_CREATE and groups:
            return create_account(claims, groups[0])
        raise SignOnRefused(
            _(
                "No account here is linked to your hospital account. Sign in once with name and "
                "password, and link it under Your account."
            )
        )
    if not user.is_active:
        raise SignOnRefused(_("This account is switched off. Ask your clinic’s lead."))
    if user.role != Role.HOST and SignOnGroup.everywhere.exists():
        own = [group for group in groups if group.clinic_id == user.clinic_id]
        if not own:
            user.end_sign_ins()
            raise SignOnRefused(
                _("Your hospital account is in no group of your clinic any more. Ask your lead.")
            )
        if own[0].role != user.role:
            user.role = own[0].role
            try:
                user.clean()
            except ValidationError as problem:
                raise SignOnRefused(problem.message) from problem
            user.save(update_fields=["role"])
    return user


def groups_of(claims: Mapping[str, Any]) -> list[SignOnGroup]:
    """Return the groups of the admin that a person is in, that with most rights first."""
    names = claims.get(settings.OIDC_GROUPS_CLAIM) or []
    listed = [names] if isinstance(names, str) else [str(name) for name in names]
    groups = SignOnGroup.everywhere.filter(name__in=listed).select_related("clinic")
    return sorted(groups, key=lambda group: STRONGEST_FIRST.index(Role(group.role)))


def create_account(claims: Mapping[str, Any], group: SignOnGroup) -> User:
    """Create an account without a password for a person whom a group lets in.

    Raises SignOnRefused where that may be an assessor, who is known here by another account.
    """
    if User.everywhere.assessors().filter(clinic=group.clinic_id, subject=None).exists():
        raise SignOnRefused(
            _(
                "An assessor of your clinic has not linked the hospital account. Until then your "
                "clinic’s lead makes new accounts, which you link under Your account."
            )
        )
    wished = str(claims.get("preferred_username") or claims["sub"])[:140]
    with transaction.atomic():
        names = (wished, *(f"{wished}-{number}" for number in range(2, 100)))
        return User.everywhere.create_user(
            next(name for name in names if not User.is_taken(name)),
            first_name=str(claims.get("given_name", ""))[:150],
            last_name=str(claims.get("family_name", ""))[:150],
            subject=claims["sub"],
            role=group.role,
            clinic=Clinic.everywhere.get(pk=group.clinic_id),
        )


def sign_out_address(request: HttpRequest, return_url: str) -> str:
    """Return where the hospital's sign-on ends, too; "" where this sign-in did not come from it."""
    hint = request.session.get(ID_TOKEN)
    if not (hint and is_configured()):
        return ""
    try:
        made = client().create_logout_url(return_url, id_token_hint=hint)
    except (OAuthError, RequestException, RuntimeError):
        return ""  # it has no page for that, or does not answer
    return str(made["url"])


def end_sign_ins(logout_token: str, now: datetime) -> None:
    """End the sign-ins of the account that the hospital's server names (Back-Channel Logout, 2.6).

    Raises SignOnRefused for a token that is not the hospital's.
    """
    try:
        keys = KeySet.import_key_set(client().fetch_jwk_set())
        claims = jwt.decode(logout_token, keys, algorithms=ALGORITHMS).claims
        audience = claims["aud"] if isinstance(claims["aud"], list) else [claims["aud"]]
        issuer = client().load_server_metadata()["issuer"]
        is_valid = (
            claims["iss"] == issuer
            and settings.OIDC_CLIENT_ID in audience
            and abs(now.timestamp() - claims["iat"]) < CLOCK_ERROR_S
            and LOGOUT_EVENT in claims["events"]
            and "nonce" not in claims
        )
        subject = str(claims["sub"])
    except (JoseError, RequestException, OAuthError, KeyError, TypeError, ValueError) as error:
        raise SignOnRefused("The logout token is not valid.") from error
    if not is_valid:
        raise SignOnRefused("The logout token is not valid.")
    for user in User.everywhere.filter(subject=subject):
        user.end_sign_ins()
