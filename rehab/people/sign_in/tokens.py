"""Tokens, by which devices and programs authenticate. Only a token's hash is ever stored."""

from __future__ import annotations

import hashlib
import secrets
from datetime import datetime, timedelta
from typing import Any, ClassVar, TypeVar, cast

from django.core.exceptions import ValidationError
from django.db import models, transaction
from django.db.models import QuerySet
from django.http import HttpRequest
from django.utils import timezone
from django.utils.translation import gettext_lazy as _

from rehab.people.audit.audit_log import Act, record_security_change
from rehab.people.models import Clinic, User
from rehab.people.roles import Role, may_delegate
from rehab.people.scope import ClinicModel, Scope

# 256 random bits: nothing to guess, so a fast hash keeps the token as safe as a slow one would.
TOKEN_BYTES = 32
LIFETIME = timedelta(days=90)  # of a program's token, unless its maker says otherwise
LONGEST_LIFETIME = timedelta(days=366)
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

    def note_issuer(self, by: User, now: datetime) -> None:
        """Note who gives the row a token by hand, where that matters. Usually it does not."""

    def new_token(self) -> str:
        """Set and return a new token; the old one stops working once the row is saved.

        Only its hash is stored.
        """
        token = draw_token()
        self.token_hash = hash_token(token)
        return token


def draw_token() -> str:
    """Return a new token. It begins with no dash: a command line would read that as an option."""
    while (token := secrets.token_urlsafe(TOKEN_BYTES)).startswith("-"):
        pass
    return token


def renew_token(holder: TokenModel, request: HttpRequest, now: datetime) -> str:
    """Store and return a new token of a row, of a revoked one too; the old one stops at once."""
    with transaction.atomic():
        record_security_change(Act.TOKEN, request, holder, now)
        token = holder.new_token()
        holder.note_issuer(cast(User, request.user), now)
        holder.revoked_at = None
        holder.save()
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


class TokenScope(models.TextChoices):
    """What a program may do with its token."""

    READ = "read", _("Read patients, sessions and boards")
    STEER = "steer", _("Add patients and sessions, change and steer them")
    EXPORT = "export", _("Take out the steps of sessions")


def default_expiry() -> datetime:
    """Return when a token of now expires."""
    return timezone.now() + LIFETIME


class ApiToken(TokenModel):
    """Lets a program use the API as a person, with that person's role or one that sees less.

    It ends when it expires or is revoked, and with its account's password, role or clinic.
    """

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
        choices=[one for one in Role.choices if one[0] not in {Role.HOST, Role.SPONSOR}],
        help_text=_(
            "The account's own role, or one that sees less: a researcher's token never "
            "reads a nickname or code."
        ),
    )
    may_read = models.BooleanField(TokenScope.READ.label, default=True)
    may_steer = models.BooleanField(TokenScope.STEER.label, default=False)
    may_export = models.BooleanField(TokenScope.EXPORT.label, default=False)
    expires_at = models.DateTimeField(
        _("valid until"),
        default=default_expiry,
        help_text=_("A year from now at the latest. Renewed, it is valid as long again."),
    )

    class Meta(TokenModel.Meta):
        verbose_name = _("API token")
        verbose_name_plural = _("API tokens")
        ordering: ClassVar = ["name"]

    def __str__(self) -> str:
        return self.name

    @property
    def scopes(self) -> frozenset[str]:
        """What the program may do."""
        return frozenset(scope.value for scope in TokenScope if getattr(self, f"may_{scope.value}"))

    def new_token(self) -> str:
        """Set and return a new token, which is valid as long as the old one was."""
        if not self._state.adding:
            self.expires_at = timezone.now() + min(
                self.expires_at - self.created_at, LONGEST_LIFETIME
            )
        return super().new_token()

    def clean(self) -> None:
        """Refuse a role that the account cannot delegate, and a date that is too far away."""
        now = timezone.now()
        expires_at: datetime | None = self.expires_at  # None where the form had no date
        if expires_at is not None and not now < expires_at <= now + LONGEST_LIFETIME:
            raise ValidationError({"expires_at": _("Give a day within a year from now.")})
        user: Any = getattr(self, "user", None)
        if user is not None and not may_delegate(user.role, self.role):
            raise ValidationError(
                {
                    "role": _("%(user)s is %(role)s: choose that role, or one below.")
                    % {"user": user, "role": user.get_role_display()}
                }
            )


def service_accounts(user: User) -> QuerySet[User]:
    """Return the accounts of programs in a person's clinic, which outlive who makes them tokens."""
    return User.objects.visible_to(user).filter(is_service=True, clinic=user.clinic_id)


def find_user_by_token(token: str, now: datetime) -> User | None:
    """Return the person that a program calls as, with the token's role; None if it is invalid.

    A token is valid until it expires, while its account is active and may delegate the role. The
    returned object is for this call alone and must not be saved.
    """
    holder = find_by_token(ApiToken, token, now)
    if holder is None or holder.expires_at <= now:
        return None
    user = holder.user
    is_valid = user.is_active and user.clinic_id == holder.clinic_id
    if not is_valid or not may_delegate(user.role, holder.role):
        return None
    user.role, user.program, user.program_scopes = holder.role, holder.name, holder.scopes
    return user


def revoke_with_account(
    instance: User, raw: bool = False, update_fields: Any = None, **_: Any
) -> None:
    """Revoke an account's tokens when its password, role or clinic changes.

    A receiver of `pre_save`: whoever knew the old password may have made a token.
    """
    if raw or instance.pk is None:
        return
    # Django has a new password there until it is stored; a hash that it renews is no new password.
    is_changed = vars(instance).get("_password") is not None
    if not is_changed and (update_fields is None or {"role", "clinic"} & set(update_fields)):
        before = User.everywhere.filter(pk=instance.pk).values_list("role", "clinic_id").first()
        is_changed = before is not None and before != (instance.role, instance.clinic_id)
    if is_changed:
        for holder in ApiToken.everywhere.filter(user=instance.pk, revoked_at__isnull=True):
            holder.revoked_at = timezone.now()
            holder.save(update_fields=["revoked_at"])
