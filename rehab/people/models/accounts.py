"""Accounts of the people who work at a clinic or run the server."""

from __future__ import annotations

from typing import Any, ClassVar

from django.contrib.auth.base_user import BaseUserManager
from django.contrib.auth.models import AbstractUser, UserManager
from django.core.exceptions import ValidationError
from django.db import models
from django.db.models import F, Q, QuerySet
from django.utils.crypto import constant_time_compare, salted_hmac
from django.utils.translation import gettext_lazy as _

from rehab.people.models.clinics import Clinic, language_choices
from rehab.people.roles import Role
from rehab.people.scope import Scope, ScopedManager

RUNNING = "running"  # a study's state while it enrolls and walks


class ServerUserManager(UserManager["User"]):
    """Accounts for the server's own work. `createsuperuser` creates a host."""

    def assessors(self) -> QuerySet[User]:
        """Return the accounts that assess in a running study, and so must not know an arm."""
        return self.filter(
            study_marks__study__state=RUNNING,
            study_marks__task="assessor",
            study_marks__ended_at=None,
        )

    def create_superuser(
        self,
        username: str,
        email: str | None = None,
        password: str | None = None,
        **extra_fields: Any,
    ) -> User:
        """Create the account of a host."""
        return self.create_user(username, email, password, **extra_fields | {"role": Role.HOST})


class ScopedUserManager(ScopedManager["User"], BaseUserManager["User"]):
    """Accounts by scope, with the helpers that Django expects of `User.objects`."""


class User(AbstractUser):
    """A person with an account. The role decides what the account may do."""

    actor_kind = "user"
    scope: ClassVar[Scope] = Scope(clinic="clinic", host=Q())

    clinic = models.ForeignKey(
        Clinic,
        on_delete=models.PROTECT,
        related_name="users",
        null=True,
        blank=True,
        verbose_name=_("clinic"),
    )
    role = models.CharField(_("role"), max_length=16, choices=Role.choices)
    language = models.CharField(
        _("language"),
        max_length=8,
        choices=language_choices,
        blank=True,
        help_text=_("Of the pages that this account opens; empty: the clinic's."),
    )
    # Who this person is at the hospital's sign-on (OpenID Connect's `sub`); None: not linked.
    subject = models.CharField(max_length=255, unique=True, null=True, editable=False)  # noqa: DJ001
    is_service = models.BooleanField(
        _("service account"),
        default=False,
        help_text=_("For a program, not a person: any lead can create its tokens."),
    )
    # Raised to end all sign-ins from before.
    sign_in_generation = models.PositiveIntegerField(default=0, editable=False)
    # The name of the API token through which this person acts, and what it may do.
    program = ""
    program_scopes: frozenset[str] = frozenset()

    everywhere = ServerUserManager()
    objects: ClassVar[ScopedUserManager] = ScopedUserManager()  # type: ignore[assignment]

    class Meta(AbstractUser.Meta):
        default_manager_name = "everywhere"
        base_manager_name = "everywhere"
        ordering: ClassVar = ["username"]
        constraints: ClassVar = [
            models.CheckConstraint(
                condition=Q(role=Role.HOST, clinic__isnull=True)
                | (~Q(role=Role.HOST) & Q(clinic__isnull=False)),
                name="user_clinic_fits_role",
                violation_error_message=_("A host has no clinic; every other role needs one."),
            ),
            models.CheckConstraint(condition=Q(role__in=Role.values), name="user_role_is_known"),
        ]

    def clean(self) -> None:
        """Refuse a role in which an assessor of a running study would learn the arms."""
        super().clean()
        if (
            self.role in {Role.LEAD, Role.HOST}
            and User.everywhere.assessors().filter(pk=self.pk).exists()
        ):
            raise ValidationError(
                _(
                    "This account assesses in a running study, and in that role would know the "
                    "arms. First end the mark on the study’s page."
                )
            )

    def save(self, *args: Any, **kwargs: Any) -> None:
        """Save the account. Django's own flags follow from the role."""
        self.is_staff = True  # everyone may open the admin; the role decides what it shows
        self.is_superuser = False  # nobody bypasses the table of rights
        if self.is_service:
            self.subject = None
            if self.has_usable_password():
                self.set_unusable_password()
        super().save(*args, **kwargs)

    def __str__(self) -> str:
        return self.get_full_name() or self.username

    def _get_session_auth_hash(self, secret: str | None = None) -> str:
        """Return what a browser session keeps of this account; when it changes, that ends."""
        may = f"{self.role} {self.clinic_id}"  # open sockets act by the rights that they began with
        what = f"{self.sign_in_generation} {may} {self.password}"
        return salted_hmac("garry.sign_in", what, secret=secret, algorithm="sha256").hexdigest()

    def has_session_hash(self, given: str) -> bool:
        """Return whether a browser session kept this of this account, by any key of the host."""
        own = (self.get_session_auth_hash(), *self.get_session_auth_fallback_hash())
        return any(constant_time_compare(given, one) for one in own)

    def end_sign_ins(self) -> None:
        """End all sign-ins of this account, also pending ones; open sockets close within seconds.

        Their browser sessions no longer sign anybody in, and go when they expire.
        """
        row = User.everywhere.filter(pk=self.pk)
        row.update(sign_in_generation=F("sign_in_generation") + 1)
        self.refresh_from_db(fields=["sign_in_generation"])

    @classmethod
    def is_taken(cls, username: str) -> bool:
        """Return whether an account of any clinic has this name; case does not matter."""
        return cls.everywhere.filter(username__iexact=username).exists()
