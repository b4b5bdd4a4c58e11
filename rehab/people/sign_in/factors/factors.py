"""Second factors: authenticator apps, passkeys and recovery codes."""

from __future__ import annotations

from datetime import datetime
from typing import ClassVar

from cryptography.fernet import InvalidToken
from django.conf import settings
from django.db import models, transaction
from django.db.models import Q
from django.utils.translation import gettext_lazy as _

from rehab.people.models import User
from rehab.people.roles import Role
from rehab.people.scope import Scope, ScopedModel
from rehab.people.server_keys import Purpose, decrypt_text, encrypt_text
from rehab.people.sign_in.factors.recovery_codes import CODE_COUNT, generate_code, hash_code
from rehab.people.sign_in.factors.totp import matching_time_step


class Authenticator(ScopedModel):
    """An authenticator app or a passkey of an account."""

    class Kind(models.TextChoices):
        """The kind of authenticator."""

        APP = "app", _("Authenticator app")
        PASSKEY = "passkey", _("Passkey")

    scope = Scope(clinic="user__clinic")

    user = models.ForeignKey(User, on_delete=models.CASCADE, related_name="authenticators")
    kind = models.CharField(max_length=8, choices=Kind.choices)
    name = models.CharField(max_length=64)
    # An app's secret, encrypted; a passkey's credential, which is public.
    credential = models.TextField()
    # An app's last time step whose code was used; a passkey's signature counter.
    counter = models.BigIntegerField(default=0)
    created_at = models.DateTimeField(auto_now_add=True)
    last_used_at = models.DateTimeField(null=True, blank=True)

    class Meta(ScopedModel.Meta):
        ordering: ClassVar = ["created_at", "pk"]

    def __str__(self) -> str:
        return self.name

    def record_use(self, counter: int, now: datetime) -> bool:
        """Store a use. Return False where this counter, or a later one, was used before."""
        unused = Q(counter__lt=counter)
        if self.kind == self.Kind.PASSKEY and counter == 0:  # synced passkeys count nothing
            unused = Q(counter=0)
        mine = Authenticator.everywhere.filter(unused, pk=self.pk)
        return bool(mine.update(counter=counter, last_used_at=now))


class RecoveryCode(ScopedModel):
    """A code that signs an account in once. Its hash is kept until it is used."""

    scope = Scope(clinic="user__clinic")

    user = models.ForeignKey(User, on_delete=models.CASCADE, related_name="recovery_codes")
    code_hash = models.CharField(max_length=64)

    class Meta(ScopedModel.Meta):
        constraints: ClassVar = [
            models.UniqueConstraint(fields=["user", "code_hash"], name="recovery_code_once")
        ]

    def __str__(self) -> str:
        return f"recovery code of {self.user}"


def is_required(user: User) -> bool:
    """Return whether an account needs a second factor to sign in.

    Its clinic decides; the hosts of a hosted server, who manage all clinics' accounts, always do.
    """
    if user.clinic is None:
        return settings.HOSTED and user.role == Role.HOST
    return user.clinic.second_factor_required


def authenticators_of(user: User) -> models.QuerySet[Authenticator]:
    """Return an account's apps and passkeys."""
    return Authenticator.everywhere.filter(user=user)


def add_authenticator(
    user: User, kind: Authenticator.Kind, name: str, credential: str, counter: int
) -> list[str]:
    """Store an authenticator, and end the account's sign-ins: somebody else may have one.

    Return the recovery codes that come with the first one.
    """
    with transaction.atomic():
        is_first = not authenticators_of(user).exists()
        Authenticator.everywhere.create(
            user=user, kind=kind, name=name, credential=credential, counter=counter
        )
        user.end_sign_ins()
        return renew_recovery_codes(user) if is_first else []


def add_app(user: User, secret: str, code: str, now: datetime) -> list[str] | None:
    """Store an app whose code shows that it has the secret. Return None for a wrong code."""
    time_step = matching_time_step(secret, code, now.timestamp())
    if time_step is None:
        return None
    kind = Authenticator.Kind.APP
    return add_authenticator(
        user, kind, str(kind.label), encrypt_text(Purpose.AUTHENTICATORS, secret), time_step
    )


def remove_authenticator(user: User, authenticator_id: int) -> bool:
    """Remove one of an account's own authenticators.

    Return False where it has to stay: the account needs one and has no other.
    """
    with transaction.atomic():
        own = list(authenticators_of(user).select_for_update().values_list("pk", flat=True))
        if is_required(user) and own == [authenticator_id]:
            return False
        authenticators_of(user).filter(pk=authenticator_id).delete()
        if own == [authenticator_id]:
            RecoveryCode.everywhere.filter(user=user).delete()
    return True


def remove_second_factors(user: User) -> None:
    """Remove all second factors of an account whose owner has lost them."""
    with transaction.atomic():
        authenticators_of(user).delete()
        RecoveryCode.everywhere.filter(user=user).delete()


def renew_recovery_codes(user: User) -> list[str]:
    """Replace the recovery codes. Return the new ones, which are stored as hashes only."""
    codes = [generate_code() for _ in range(CODE_COUNT)]
    with transaction.atomic():
        RecoveryCode.everywhere.filter(user=user).delete()
        RecoveryCode.everywhere.bulk_create(
            RecoveryCode(user=user, code_hash=hash_code(code, user.pk, user.date_joined))
            for code in codes
        )
    return codes


def count_recovery_codes(user: User) -> int:
    """Return the number of an account's unused recovery codes."""
    return RecoveryCode.everywhere.filter(user=user).count()


def verify_code(user: User, code: str, now: datetime) -> bool:
    """Return whether a code, of an app or for recovery, signs an account in. Each does so once."""
    for app in authenticators_of(user).filter(kind=Authenticator.Kind.APP):
        try:
            secret = decrypt_text(Purpose.AUTHENTICATORS, app.credential)
        except InvalidToken:  # the server's secret key has changed; recovery codes still work
            continue
        time_step = matching_time_step(secret, code, now.timestamp())
        if time_step is not None and app.record_use(time_step, now):
            return True
    typed = hash_code(code, user.pk, user.date_joined)
    used, _ = RecoveryCode.everywhere.filter(user=user, code_hash=typed).delete()
    return bool(used)
