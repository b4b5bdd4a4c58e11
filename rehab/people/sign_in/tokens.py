"""Tokens, by which devices and programs authenticate. Only a token's hash is ever stored."""

from __future__ import annotations

import hashlib
import secrets
from datetime import datetime, timedelta
from typing import Any, ClassVar, TypeVar

from django.core.exceptions import ValidationError
from django.db import models
from django.utils.translation import gettext_lazy as _

from rehab.people.models import Clinic, User
from rehab.people.roles import Role, may_delegate
from rehab.people.scope import ClinicModel, Scope

# 256 random bits: nothing to guess, so a fast hash keeps the token as safe as a slow one would.
TOKEN_BYTES = 32
LAST_SEEN_RESOLUTION = timedelta(minutes=1)  # precision of `last_seen_at`


def hash_token(token: str) -> str:
    """Return the hash of a token, the only form that is ever stored."""
    return hashlib.sha256(token.encode()).hexdigest()


class TokenModel(ClinicModel):
    """A model whose rows authenticate by a token, until it is renewed or revoked."""

    token_hash = models.CharField(max_length=64, unique=True, editable=False)
    created_at = models.DateTimeField(_("created at"), auto_now_add=True)
    last_seen_at = models.DateTimeField(_("last seen at"), null=True, blank=True, editable=False)
    revoked_at = models.DateTimeField(_("revoked at"), null=True, blank=True, editable=False)

    class Meta(ClinicModel.Meta):
        abstract = True

    @property
    def is_revoked(self) -> bool:
        """Return whether the token is revoked."""
        return self.revoked_at is not None

    def new_token(self) -> str:
        """Set and return a new token; the old one stops working once the row is saved.

        Only its hash is stored.
        """
        token = secrets.token_urlsafe(TOKEN_BYTES)
        self.token_hash = hash_token(token)
        return token


T = TypeVar("T", bound=TokenModel)


def find_by_token(model: type[T], token: str, now: datetime) -> T | None:
    """Return the row that this token belongs to; None for an unknown or revoked one."""
    rows = model.everywhere.filter(token_hash=hash_token(token), revoked_at__isnull=True)
    holder: T | None = rows.select_related("clinic").first()  # for the language of its pages
    if holder is None:
        return None
    if holder.last_seen_at is None or now - holder.last_seen_at > LAST_SEEN_RESOLUTION:
        model.everywhere.filter(pk=holder.pk).update(last_seen_at=now)
    return holder


class ApiToken(TokenModel):
    """Lets a program use the API as a person, with that person's role or one that sees less."""

    scope = Scope(clinic="clinic")

    clinic = models.ForeignKey(
        Clinic, on_delete=models.CASCADE, related_name="api_tokens", verbose_name=_("clinic")
    )
    user = models.ForeignKey(
        User,
        on_delete=models.CASCADE,
        related_name="api_tokens",
        verbose_name=_("account"),
        help_text=_("What the program does is noted as done by this account."),
    )
    name = models.CharField(_("name"), max_length=64, help_text=_("What the token is for."))
    role = models.CharField(
        _("role"),
        max_length=16,
        choices=[choice for choice in Role.choices if choice[0] != Role.HOST],
        help_text=_(
            "The account's own role, or one that sees less: a researcher's token never "
            "reads a nickname or code."
        ),
    )

    class Meta(TokenModel.Meta):
        verbose_name = _("API token")
        verbose_name_plural = _("API tokens")
        ordering: ClassVar = ["name"]

    def __str__(self) -> str:
        return self.name

    def clean(self) -> None:
        """Refuse a role that the account cannot delegate."""
        user: Any = getattr(self, "user", None)
        if user is not None and not may_delegate(user.role, self.role):
            raise ValidationError(
                {
                    "role": _("%(user)s is %(role)s: choose that role, or one below.")
                    % {"user": user, "role": user.get_role_display()}
                }
            )


def find_user_by_token(token: str, now: datetime) -> User | None:
    """Return the person that a program calls as, with the token's role; None if it is invalid.

    A token is valid while its account is active and may delegate the role. The returned object is
    for this call alone and must not be saved.
    """
    holder = find_by_token(ApiToken, token, now)
    if holder is None:
        return None
    user = holder.user
    is_valid = user.is_active and user.clinic_id == holder.clinic_id
    if not is_valid or not may_delegate(user.role, holder.role):
        return None
    user.role, user.program = holder.role, holder.name
    return user
