"""Forms to sign in and to manage one's own account."""

from __future__ import annotations

from typing import Any

from django import forms
from django.contrib.auth import authenticate
from django.contrib.auth.forms import AuthenticationForm, PasswordChangeForm
from django.core.exceptions import ValidationError
from django.http import HttpRequest
from django.utils.translation import gettext_lazy as _

from rehab.people.models import User
from rehab.people.sign_in import lockout
from rehab.people.sign_in.factors import factors

WRONG_LOGIN = _("Name and password do not match. Check capital letters, and try again.")
WRONG_PASSWORD = _("That is not your password.")
WRONG_FIRST_CODE = _("This code is not right. Check the app again.")
WRONG = {
    "password": WRONG_PASSWORD,
    "code": _("This code is not right, or has been used. Wait for the next one, and try again."),
    "passkey": _("This passkey was not accepted. Try again, or type a code."),
}


class SignInForm(AuthenticationForm):
    """Name and password. Refuses sign-ins that are locked out."""

    def get_invalid_login_error(self) -> ValidationError:
        """Return the error, which does not reveal whether there is such an account."""
        assert self.request is not None  # noqa: S101  (the view gives it)
        return ValidationError(lockout.lockout_message(self.request) or WRONG_LOGIN)


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


class FactorForm(forms.Form):
    """A second factor of an account: a code, or a passkey's signature."""

    code = CodeField(label=_("Recovery code"), required=False)
    passkey = forms.CharField(required=False, widget=forms.HiddenInput)

    def __init__(self, request: HttpRequest, user: User, *args: Any, **kwargs: Any) -> None:
        super().__init__(*args, **kwargs)
        self.request, self.user = request, user
        next(iter(self.fields.values())).widget.attrs["autofocus"] = True
        if factors.authenticators_of(user).filter(kind=factors.Authenticator.Kind.APP).exists():
            self.fields["code"].label = _("Code in your authenticator app")
            self.fields["code"].help_text = _("Six digits, or one of your recovery codes.")

    def clean(self) -> dict[str, Any]:
        """Refuse what is wrong or was used before, and everything during a lockout."""
        shown = {name: value for name, value in self.cleaned_data.items() if value}
        first = next(iter(self.fields), None)
        if not shown and not self.errors:
            self.add_error(first, forms.Field.default_error_messages["required"])
        for name, value in list(shown.items())[:1]:
            if authenticate(self.request, username=self.user.username, **{name: value}) is None:
                self.add_error(name, lockout.lockout_message(self.request) or WRONG[name])
        return self.cleaned_data


class ProofForm(FactorForm):
    """The own password or a factor, asked for again: whichever of them the account has."""

    field_order = ("password", "code", "passkey")
    password = forms.CharField(
        label=_("Your password"),
        strip=False,
        required=False,
        widget=forms.PasswordInput(attrs={"autocomplete": "current-password"}),
    )

    def __init__(self, request: HttpRequest, user: User, *args: Any, **kwargs: Any) -> None:
        super().__init__(request, user, *args, **kwargs)
        if not factors.authenticators_of(user).exists():
            del self.fields["code"], self.fields["passkey"]
        elif user.has_usable_password():
            self.fields["code"].label = _("Or a code")
        if not user.has_usable_password():
            del self.fields["password"]


class AppForm(forms.Form):
    """The first code of an app that has just read its secret."""

    code = CodeField(label=_("Code that the app shows"))


class NewPasswordForm(PasswordChangeForm):
    """A new password, with the old one."""

    def __init__(self, request: HttpRequest, user: User, *args: Any, **kwargs: Any) -> None:
        super().__init__(user, *args, **kwargs)
        self.request = request
        self.fields["new_password1"].help_text = _(
            "At least 12 characters; a few words are easy to keep. Other devices are signed out."
        )

    def clean_old_password(self) -> str:
        """Refuse a wrong old password."""
        assert isinstance(self.user, User)  # noqa: S101
        return check_own_password(self.request, self.user, self.cleaned_data["old_password"])


def check_own_password(request: HttpRequest, user: User, password: str) -> str:
    """Return the password. Raises ValidationError where it is wrong, and counts the attempt."""
    if authenticate(request, username=user.username, password=password) is None:
        raise ValidationError(lockout.lockout_message(request) or WRONG_PASSWORD)
    return password
