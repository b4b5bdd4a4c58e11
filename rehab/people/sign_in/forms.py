"""Forms to sign in and to manage one's own account."""

from __future__ import annotations

from typing import Any

from django import forms
from django.contrib.auth import authenticate
from django.contrib.auth.forms import AuthenticationForm, PasswordChangeForm
from django.core.exceptions import ValidationError
from django.http import HttpRequest
from django.utils import timezone
from django.utils.translation import gettext_lazy as _

from rehab.people.models import User
from rehab.people.sign_in import lockout

WRONG_LOGIN = _("Name and password do not fit. Look at capitals, and try again.")
WRONG_PASSWORD = _("That is not your password.")
WRONG_FIRST_CODE = _("This code does not fit. Look at the app again.")
WRONG_CODE = _("This code does not fit, or was used. Wait for the next one, and try again.")


class SignInForm(AuthenticationForm):
    """Name and password. Refuses sign-ins that are locked out."""

    def get_invalid_login_error(self) -> ValidationError:
        """Return the error, which does not reveal whether there is such an account."""
        assert self.request is not None  # noqa: S101  (the view gives it)
        name = str(self.cleaned_data["username"])
        locked_out = lockout.lockout_message(self.request, timezone.now(), username=name)
        return ValidationError(locked_out or WRONG_LOGIN)


class CodeField(forms.CharField):
    """A code of an app or for recovery."""

    widget = forms.TextInput(
        attrs={
            "autocomplete": "one-time-code",
            "autocapitalize": "characters",
            "spellcheck": "false",
        }
    )

    def __init__(self, **kwargs: Any) -> None:
        super().__init__(max_length=32, **kwargs)


class CodeForm(forms.Form):
    """The code of a pending sign-in."""

    code = CodeField(label=_("Code"))

    def __init__(self, request: HttpRequest, user: User, *args: Any, **kwargs: Any) -> None:
        super().__init__(*args, **kwargs)
        self.request, self.user = request, user
        self.fields["code"].widget.attrs["autofocus"] = True

    def clean_code(self) -> str:
        """Refuse a wrong or used code, and every code during a lockout."""
        code: str = self.cleaned_data["code"]
        if authenticate(self.request, username=self.user.username, code=code) is None:
            username = self.user.username
            locked_out = lockout.lockout_message(
                self.request, timezone.now(), username=username, code=""
            )
            raise ValidationError(locked_out or WRONG_CODE)
        return code


class AppForm(forms.Form):
    """The first code of an app that has just read its secret."""

    code = CodeField(label=_("Code that the app shows"))


class OwnPasswordForm(forms.Form):
    """The own password, asked for again before security settings change."""

    password = forms.CharField(
        label=_("Your password"),
        strip=False,
        widget=forms.PasswordInput(attrs={"autocomplete": "current-password"}),
    )

    def __init__(self, request: HttpRequest, user: User, *args: Any, **kwargs: Any) -> None:
        super().__init__(*args, **kwargs)
        self.request, self.user = request, user

    def clean_password(self) -> str:
        """Refuse a wrong password."""
        return check_own_password(self.request, self.user, self.cleaned_data["password"])


class NewPasswordForm(PasswordChangeForm):
    """A new password, with the old one."""

    def __init__(self, request: HttpRequest, user: User, *args: Any, **kwargs: Any) -> None:
        super().__init__(user, *args, **kwargs)
        self.request = request

    def clean_old_password(self) -> str:
        """Refuse a wrong old password."""
        assert isinstance(self.user, User)  # noqa: S101
        return check_own_password(self.request, self.user, self.cleaned_data["old_password"])


def check_own_password(request: HttpRequest, user: User, password: str) -> str:
    """Return the password. Raises ValidationError where it is wrong, and counts the attempt."""
    if authenticate(request, username=user.username, password=password) is None:
        locked_out = lockout.lockout_message(request, timezone.now(), username=user.username)
        raise ValidationError(locked_out or WRONG_PASSWORD)
    return password
