"""Authentication backends: the password, and the codes of second factors."""

from __future__ import annotations

from typing import Any

from django.contrib.auth.backends import ModelBackend
from django.http import HttpRequest
from django.utils import timezone

from rehab.people.models import User
from rehab.people.sign_in import factors


class PasswordBackend(ModelBackend):
    """Django's backend; it also loads the clinic, which every page needs."""

    def get_user(self, user_id: Any) -> User | None:
        """Return the account of a browser session; None for one that is not active."""
        user = User.everywhere.select_related("clinic").filter(pk=user_id).first()
        return user if self.user_can_authenticate(user) else None


class CodeBackend:
    """Accepts a code of an authenticator app, or a recovery code. Signs nobody in by itself."""

    def authenticate(self, request: HttpRequest | None, username: str, code: str) -> User | None:
        """Return the account where the code is valid; else None."""
        user = User.everywhere.filter(username=username, is_active=True).first()
        return user if user and factors.verify_code(user, code, timezone.now()) else None
