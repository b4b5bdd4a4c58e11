"""Authentication backends: the counting of attempts, then the password, codes and passkeys."""

from __future__ import annotations

from typing import Any

from django.contrib.auth.backends import ModelBackend
from django.core.exceptions import PermissionDenied
from django.http import HttpRequest
from django.utils import timezone

from rehab.people.models import User
from rehab.people.sign_in import lockout
from rehab.people.sign_in.factors import factors, passkeys
from rehab.people.sign_in.hashing import HashingBusy


class CountingBackend:
    """Counts each attempt before the other backends check it. Signs nobody in."""

    def authenticate(self, request: HttpRequest | None, **credentials: Any) -> None:
        """Raise PermissionDenied during a lockout, which ends the attempt."""
        if request is None:
            raise TypeError("Attempts to sign in are counted by address: give the request.")
        if not lockout.is_allowed(request, credentials):
            raise PermissionDenied


class PasswordBackend(ModelBackend):
    """Django's backend; it also loads the clinic, which every page needs."""

    def authenticate(
        self,
        request: HttpRequest | None,
        username: str | None = None,
        password: str | None = None,
        **kwargs: Any,
    ) -> User | None:
        """Return the account where the password is right; else None."""
        try:
            user = super().authenticate(request, username, password, **kwargs)
        except HashingBusy:
            lockout.take_back(request, username=username or "")
            raise
        if user is None:
            return None
        lockout.take_back(request, username=username or "")
        return user

    def get_user(self, user_id: Any) -> User | None:
        """Return the account of a browser session; None for one that is not active."""
        user = User.everywhere.select_related("clinic").filter(pk=user_id).first()
        return user if self.user_can_authenticate(user) else None


class CodeBackend:
    """Accepts a code of an authenticator app, or a recovery code. Signs nobody in by itself."""

    def authenticate(self, request: HttpRequest | None, username: str, code: str) -> User | None:
        """Return the account where the code is valid; else None."""
        user = User.everywhere.filter(username=username, is_active=True).first()
        if user is None or not factors.verify_code(user, code, timezone.now()):
            return None
        lockout.take_back(request, username=username, code="")
        return user


class PasskeyBackend:
    """Accepts a passkey's signature of this browser's challenge. Signs nobody in by itself."""

    def authenticate(self, request: HttpRequest, username: str, passkey: str) -> User | None:
        """Return the account where the signature verifies; else None."""
        user = User.everywhere.filter(username=username, is_active=True).first()
        if user is None:
            return None
        try:
            passkeys.verify(request, user, passkey, timezone.now())
        except passkeys.PasskeyRejected:
            return None
        lockout.take_back(request, username=username, passkey="")
        return user
