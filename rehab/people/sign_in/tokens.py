"""Tokens: how devices and programs say who they are. Only a token's hash is ever stored."""

from __future__ import annotations

import hashlib
import secrets
from datetime import datetime, timedelta
from typing import Any, ClassVar, TypeVar

from django.core.exceptions import ValidationError
from django.db import models
from django.utils.translation import gettext_lazy as _

from rehab.people.models import Clinic, User
from rehab.people.roles import Role, may_lend
from rehab.people.scope import ClinicRow, Scope

# 256 random bits: nothing to guess, so a fast hash keeps the token as safe as a slow one would.
TOKEN_BYTES = 32
SEEN_EVERY = timedelta(minutes=1)  # so exactly is it known when a token was last used


def hash_token(token: str) -> str:
    """Give the only form of a token that is ever stored."""
    return hashlib.sha256(token.encode()).hexdigest()


class TokenRow(ClinicRow):
    """A row that is known by its token, until that is renewed or revoked."""

    token_hash = models.CharField(max_length=64, unique=True, editable=False)
    created_at = models.DateTimeField(_("created at"), auto_now_add=True)
    last_seen_at = models.DateTimeField(_("last seen at"), null=True, blank=True, editable=False)
    revoked_at = models.DateTimeField(_("revoked at"), null=True, blank=True, editable=False)

    class Meta(ClinicRow.Meta):
        abstract = True

    @property
    def is_revoked(self) -> bool:
        """Whether the token no longer opens anything."""
        return self.revoked_at is not None

    def new_token(self) -> str:
        """Give the row a new token; the old one is dead once the row is saved.

        The token is returned this one time and never stored.
        """
        token = secrets.token_urlsafe(TOKEN_BYTES)
        self.token_hash = hash_token(token)
        return token


T = TypeVar("T", bound=TokenRow)


def find_holder(model: type[T], token: str, now: datetime) -> T | None:
    """Give the row that this token belongs to; None for an unknown or revoked one."""
    held = model.everywhere.filter(token_hash=hash_token(token), revoked_at__isnull=True)
    holder: T | None = held.select_related("clinic").first()  # whose language its pages have
    if holder is None:
        return None
    if holder.last_seen_at is None or now - holder.last_seen_at > SEEN_EVERY:
        model.everywhere.filter(pk=holder.pk).update(last_seen_at=now)
    return holder


class ApiToken(TokenRow):
    """Lets a program use the API as somebody, with that person's role or one that sees less."""

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

    class Meta(TokenRow.Meta):
        verbose_name = _("API token")
        verbose_name_plural = _("API tokens")
        ordering: ClassVar = ["name"]

    def __str__(self) -> str:
        return self.name

    def clean(self) -> None:
        """Refuse a role that the account could not lend."""
        user: Any = getattr(self, "user", None)
        if user is not None and not may_lend(user.role, self.role):
            raise ValidationError(
                {
                    "role": _("%(user)s is %(role)s: choose that role, or one below.")
                    % {"user": user, "role": user.get_role_display()}
                }
            )


def find_caller(token: str, now: datetime) -> User | None:
    """Give the person that a program calls as, with the token's role; None for a dead token.

    A token dies with its account, and with the account's right to lend its role. The person is for
    this call alone and never saved.
    """
    holder = find_holder(ApiToken, token, now)
    if holder is None:
        return None
    user = holder.user
    is_alive = user.is_active and user.clinic_id == holder.clinic_id
    if not is_alive or not may_lend(user.role, holder.role):
        return None
    user.role, user.program = holder.role, holder.name
    return user
