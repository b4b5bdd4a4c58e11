"""Who may come in: by password, then by the code of a second factor."""

from __future__ import annotations

from typing import Any

from django.contrib.auth.backends import ModelBackend
from django.http import HttpRequest
from django.utils import timezone

from rehab.people.models import User
from rehab.people.sign_in import factors


class PasswordBackend(ModelBackend):
    """Django's own, which also brings the clinic along: every page asks for it."""

    def get_user(self, user_id: Any) -> User | None:
        """Give the account of a sign-in; None for one that is switched off."""
        user = User.everywhere.select_related("clinic").filter(pk=user_id).first()
        return user if self.user_can_authenticate(user) else None


class CodeBackend:
    """Takes a code of an authenticator app, or a recovery code. It signs nobody in by itself."""

    def authenticate(self, request: HttpRequest | None, username: str, code: str) -> User | None:
        """Give the account where the code is good; None for any other."""
        user = User.everywhere.filter(username=username, is_active=True).first()
        return user if user and factors.take_code(user, code, timezone.now()) else None
