"""Pages to enroll a second factor, from the own account or during a pending sign-in."""

from __future__ import annotations

import segno
from django.contrib import messages
from django.contrib.auth import update_session_auth_hash
from django.core.exceptions import PermissionDenied
from django.http import Http404, HttpRequest, HttpResponse
from django.shortcuts import redirect, render
from django.urls import reverse
from django.utils import timezone
from django.utils.translation import gettext as _
from django.views.decorators.cache import never_cache
from django.views.decorators.debug import sensitive_post_parameters
from django.views.decorators.http import require_http_methods, require_safe

from rehab.people.access import for_roles, user_of
from rehab.people.audit import audit_log, sign_in_log
from rehab.people.audit.audit_log import Act
from rehab.people.models import User
from rehab.people.networks import client_address
from rehab.people.pages.confirm import ask_again
from rehab.people.roles import Role
from rehab.people.row_values import read_key
from rehab.people.sign_in import step_up, two_stage_sign_in
from rehab.people.sign_in.factors import factors, passkeys, totp
from rehab.people.sign_in.forms import WRONG_FIRST_CODE, AppForm

SECRET = "app_secret"  # noqa: S105 (key of the browser session, until the app has shown a code)


def enrolling_user(request: HttpRequest) -> User:
    """Return the account that may enroll a factor. Raises PermissionDenied for a stranger."""
    if isinstance(request.user, User):
        return request.user
    user = two_stage_sign_in.pending_enrollment(request, timezone.now())
    if user is None:
        raise PermissionDenied
    return user


@for_roles(*Role, enrolling=True, patients=False)
@step_up.required
@never_cache
@require_safe
def choose_factor(request: HttpRequest) -> HttpResponse:
    """Show the kinds of second factors that can be enrolled here."""
    user = enrolling_user(request)
    context = {
        "owner": user,
        "is_required": factors.is_required(user),
        "passkeys": passkeys.are_supported(request),
    }
    return render(request, "people/sign_in/choose_factor.html", context)


@for_roles(*Role, enrolling=True, patients=False)
@step_up.required
@never_cache
@sensitive_post_parameters()
@require_http_methods(["GET", "HEAD", "POST"])
def add_app(request: HttpRequest) -> HttpResponse:
    """Show the secret for an app, and store it once the app has shown the right code."""
    user = enrolling_user(request)
    secret: str = request.session.setdefault(SECRET, totp.generate_secret())
    form = AppForm(request.POST if request.method == "POST" else None)
    if form.is_valid():
        new = factors.add_app(user, secret, form.cleaned_data["code"], timezone.now())
        if new is not None:
            del request.session[SECRET]
            return _finish_enrollment(request, user, new)
        form.add_error("code", WRONG_FIRST_CODE)
        sign_in_log.record_refused_factor(user, request)
    uri = totp.provisioning_uri(secret, user.username)
    qr = segno.make(uri, micro=False).svg_inline(omitsize=True, border=2)
    spaced = " ".join(secret[start : start + 4] for start in range(0, len(secret), 4))
    context = {"form": form, "uri": uri, "qr": qr, "secret": spaced}
    return render(request, "people/sign_in/add_app.html", context)


@for_roles(*Role, enrolling=True, patients=False)
@step_up.required
@never_cache
@require_http_methods(["GET", "HEAD", "POST"])
def add_passkey(request: HttpRequest) -> HttpResponse:
    """Have the browser create a passkey, and store it."""
    user = enrolling_user(request)
    if not passkeys.are_supported(request):
        raise Http404
    problem = ""
    if request.method == "POST":
        name = request.POST.get("name", "").strip()[:64] or _("Passkey")
        try:
            return _finish_enrollment(
                request, user, passkeys.register(request, user, name, request.POST["passkey"])
            )
        except (KeyError, passkeys.PasskeyRejected):
            problem = _("This passkey was not accepted. Try again.")
            sign_in_log.record_refused_factor(user, request)
    context = {"problem": problem, "passkey": passkeys.registration_options(request, user)}
    return render(request, "people/sign_in/add_passkey.html", context)


def _finish_enrollment(request: HttpRequest, user: User, new: list[str]) -> HttpResponse:
    """Finish a pending sign-in, if there is one, and show new recovery codes."""
    next_url = reverse("account")
    if request.user.is_authenticated:
        update_session_auth_hash(request, user)  # this sign-in goes on, no other one
        request.session[two_stage_sign_in.SECOND_FACTOR_VERIFIED] = True
    else:
        next_url = two_stage_sign_in.finish(
            request, user, timezone.now(), second_factor_verified=True
        )
    if not new:
        messages.success(request, _("Added."))
        return redirect(next_url)
    return _show_recovery_codes(request, new, next_url)


@for_roles(*Role, patients=False)
@never_cache
@sensitive_post_parameters()
@require_http_methods(["GET", "HEAD", "POST"])
def renew_codes(request: HttpRequest) -> HttpResponse:
    """Make new recovery codes for an account with a second factor, which is asked who it is."""
    user = user_of(request)
    if not factors.authenticators_of(user).exists():
        return redirect("account")
    asked = ask_again(
        request,
        _("New recovery codes"),
        _("They replace the old ones, which then open nothing."),
        _("Make new codes"),
    )
    if asked is not None:
        return asked
    audit_log.record(Act.RECOVERY_CODES, user, address=client_address(request), now=timezone.now())
    return _show_recovery_codes(request, factors.renew_recovery_codes(user), reverse("account"))


def _show_recovery_codes(request: HttpRequest, new: list[str], next_url: str) -> HttpResponse:
    return render(
        request, "people/sign_in/recovery_codes.html", {"codes": new, "next_url": next_url}
    )


@for_roles(*Role, patients=False)
@never_cache
@sensitive_post_parameters()
@require_http_methods(["GET", "HEAD", "POST"])
def remove_authenticator(request: HttpRequest) -> HttpResponse:
    """Remove one of the own authenticators, after asking who it is."""
    user = user_of(request)
    which = read_key(request.GET.get("which", ""))
    own = factors.authenticators_of(user).filter(pk=which).first()
    if own is None:
        return redirect("account")
    asked = ask_again(
        request,
        _("Remove %(name)s") % {"name": own},
        _("It then no longer signs you in."),
        _("Remove"),
    )
    if asked is not None:
        return asked
    if factors.remove_authenticator(user, own.pk):
        messages.success(request, _("%(name)s is removed.") % {"name": own})
    else:
        messages.error(request, _("Your clinic asks for a second factor. Add another one first."))
    return redirect("account")
