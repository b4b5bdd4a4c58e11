"""What proves, beside the password, that it is you: an app with codes, passkeys, recovery codes."""

from __future__ import annotations

from base64 import urlsafe_b64encode
from datetime import datetime
from typing import ClassVar

from cryptography.fernet import Fernet, InvalidToken
from django.conf import settings
from django.db import models, transaction
from django.db.models import Q
from django.utils.crypto import salted_hmac
from django.utils.translation import gettext_lazy as _

from rehab.people.models import User
from rehab.people.roles import Role
from rehab.people.scope import Scope, ScopedModel
from rehab.people.sign_in.recovery_codes import RECOVERY_CODES, digest_of, new_recovery_code
from rehab.people.sign_in.totp import step_of


class Authenticator(ScopedModel):
    """An app or a passkey of an account."""

    class Kind(models.TextChoices):
        """What it is."""

        APP = "app", _("Authenticator app")
        PASSKEY = "passkey", _("Passkey")

    scope = Scope(clinic="user__clinic")

    user = models.ForeignKey(User, on_delete=models.CASCADE, related_name="authenticators")
    kind = models.CharField(max_length=8, choices=Kind.choices)
    name = models.CharField(max_length=64)
    # An app's secret, sealed; a passkey's credential, which is public.
    material = models.TextField()
    # The last time step of which a code was taken; a passkey's count of signatures.
    count = models.BigIntegerField(default=0)
    created_at = models.DateTimeField(auto_now_add=True)
    last_used_at = models.DateTimeField(null=True, blank=True)

    class Meta(ScopedModel.Meta):
        ordering: ClassVar = ["created_at", "pk"]

    def __str__(self) -> str:
        return self.name

    def use(self, count: int, now: datetime) -> bool:
        """Note a use. False where another one with this count, or a later one, came before."""
        fresh = Q(count__lt=count)
        if self.kind == self.Kind.PASSKEY and count == 0:  # passkeys of several devices count none
            fresh = Q(count=0)
        mine = Authenticator.everywhere.filter(fresh, pk=self.pk)
        return bool(mine.update(count=count, last_used_at=now))


class RecoveryCode(ScopedModel):
    """A code that lets an account in once, kept as its digest until it is used."""

    scope = Scope(clinic="user__clinic")

    user = models.ForeignKey(User, on_delete=models.CASCADE, related_name="recovery_codes")
    digest = models.CharField(max_length=64)

    class Meta(ScopedModel.Meta):
        constraints: ClassVar = [
            models.UniqueConstraint(fields=["user", "digest"], name="recovery_code_once")
        ]

    def __str__(self) -> str:
        return f"recovery code of {self.user}"


def is_required(user: User) -> bool:
    """Whether an account may not come in without one: its clinic says so; a hosted server's
    hosts, who make the accounts of all clinics, always need one.
    """
    if user.clinic is None:
        return settings.HOSTED and user.role == Role.HOST
    return user.clinic.second_factor_required


def authenticators_of(user: User) -> models.QuerySet[Authenticator]:
    """Give an account's apps and passkeys."""
    return Authenticator.everywhere.filter(user=user)


def add(user: User, kind: Authenticator.Kind, name: str, material: str, count: int) -> list[str]:
    """Keep an authenticator. The first one brings recovery codes, which are given this once."""
    with transaction.atomic():
        is_first = not authenticators_of(user).exists()
        Authenticator.everywhere.create(
            user=user, kind=kind, name=name, material=material, count=count
        )
        return renew_recovery_codes(user) if is_first else []


def add_app(user: User, secret: str, code: str, now: datetime) -> list[str] | None:
    """Keep an app whose code proves that it has the secret; None for a wrong code."""
    step = step_of(secret, code, now.timestamp())
    if step is None:
        return None
    kind = Authenticator.Kind.APP
    return add(user, kind, str(kind.label), _vault().encrypt(secret.encode()).decode(), step)


def remove(user: User, authenticator_id: int) -> bool:
    """Forget one of an account's own authenticators. False where it has to stay: the account
    needs one and has no other.
    """
    with transaction.atomic():
        own = list(authenticators_of(user).select_for_update().values_list("pk", flat=True))
        if is_required(user) and own == [authenticator_id]:
            return False
        authenticators_of(user).filter(pk=authenticator_id).delete()
        if own == [authenticator_id]:
            RecoveryCode.everywhere.filter(user=user).delete()
    return True


def forget_all(user: User) -> None:
    """Take an account back to its password alone: its owner has lost what it had."""
    with transaction.atomic():
        authenticators_of(user).delete()
        RecoveryCode.everywhere.filter(user=user).delete()


def renew_recovery_codes(user: User) -> list[str]:
    """Make new recovery codes in place of the old ones. They can be read this once."""
    codes = [new_recovery_code() for _ in range(RECOVERY_CODES)]
    with transaction.atomic():
        RecoveryCode.everywhere.filter(user=user).delete()
        RecoveryCode.everywhere.bulk_create(
            RecoveryCode(user=user, digest=digest_of(code)) for code in codes
        )
    return codes


def recovery_codes_left(user: User) -> int:
    """Give how many recovery codes an account has not used."""
    return RecoveryCode.everywhere.filter(user=user).count()


def take_code(user: User, code: str, now: datetime) -> bool:
    """Whether a code lets an account in: an app's, or a recovery code. Each does so once."""
    for app in authenticators_of(user).filter(kind=Authenticator.Kind.APP):
        try:
            secret = _vault().decrypt(app.material).decode()
        except InvalidToken:  # the server's secret key has changed; recovery codes go on to count
            continue
        step = step_of(secret, code, now.timestamp())
        if step is not None and app.use(step, now):
            return True
    used, _ = RecoveryCode.everywhere.filter(user=user, digest=digest_of(code)).delete()
    return bool(used)


def _vault() -> Fernet:
    """Seal secrets with the server's own, so that a copy of the database alone opens nothing."""
    return Fernet(urlsafe_b64encode(salted_hmac(__name__, "apps", algorithm="sha256").digest()))
