"""Forms with which people sign in and manage their own account."""

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

WRONG = _("Name and password do not fit. Look at capitals, and try again.")


WRONG_PASSWORD = _("That is not your password.")


WRONG_FIRST_CODE = _("This code does not fit. Look at the app again.")


WRONG_CODE = _("This code does not fit, or was used. Wait for the next one, and try again.")


class SignInForm(AuthenticationForm):
    """Name and password. Refuses everyone who has guessed too often."""

    def get_invalid_login_error(self) -> ValidationError:
        """Say what is wrong, without telling whether there is such an account."""
        assert self.request is not None  # noqa: S101  (the view gives it)
        name = str(self.cleaned_data["username"])
        wait = lockout.wait_of(self.request, timezone.now(), username=name)
        return ValidationError(wait or WRONG)


class CodeField(forms.CharField):
    """A code: of an app, or for recovery."""

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
    """The code that takes somebody the second half of the way."""

    code = CodeField(label=_("Code"))

    def __init__(self, request: HttpRequest, user: User, *args: Any, **kwargs: Any) -> None:
        super().__init__(*args, **kwargs)
        self.request, self.user = request, user
        self.fields["code"].widget.attrs["autofocus"] = True

    def clean_code(self) -> str:
        """Refuse a code that is wrong or was used, and any code after too many wrong ones."""
        code: str = self.cleaned_data["code"]
        if authenticate(self.request, username=self.user.username, code=code) is None:
            username = self.user.username
            wait = lockout.wait_of(self.request, timezone.now(), username=username, code="")
            raise ValidationError(wait or WRONG_CODE)
        return code


class AppForm(forms.Form):
    """The first code of an app that has just read the secret."""

    code = CodeField(label=_("Code that the app shows"))


class OwnPasswordForm(forms.Form):
    """The own password, asked for again before something that a passer-by must not do."""

    password = forms.CharField(
        label=_("Your password"),
        strip=False,
        widget=forms.PasswordInput(attrs={"autocomplete": "current-password"}),
    )

    def __init__(self, request: HttpRequest, user: User, *args: Any, **kwargs: Any) -> None:
        super().__init__(*args, **kwargs)
        self.request, self.user = request, user

    def clean_password(self) -> str:
        """Refuse any other."""
        return check_own_password(self.request, self.user, self.cleaned_data["password"])


class NewPasswordForm(PasswordChangeForm):
    """A new password in place of the old one."""

    def __init__(self, request: HttpRequest, user: User, *args: Any, **kwargs: Any) -> None:
        super().__init__(user, *args, **kwargs)
        self.request = request

    def clean_old_password(self) -> str:
        """Refuse anything but the old one."""
        assert isinstance(self.user, User)  # noqa: S101
        return check_own_password(self.request, self.user, self.cleaned_data["old_password"])


def check_own_password(request: HttpRequest, user: User, password: str) -> str:
    """Give the password back. Raises ValidationError where it is wrong; guesses are counted."""
    if authenticate(request, username=user.username, password=password) is None:
        wait = lockout.wait_of(request, timezone.now(), username=user.username)
        raise ValidationError(wait or WRONG_PASSWORD)
    return password
