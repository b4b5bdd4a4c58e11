"""Pages of the own account."""

from __future__ import annotations

from django.contrib import messages
from django.contrib.auth import update_session_auth_hash
from django.http import HttpRequest, HttpResponse
from django.shortcuts import redirect, render
from django.utils import timezone
from django.utils.translation import gettext as _
from django.views.decorators.cache import never_cache
from django.views.decorators.debug import sensitive_post_parameters
from django.views.decorators.http import require_http_methods, require_POST, require_safe

from rehab.people.access import for_roles, user_of
from rehab.people.audit.audit_log import Act, record_security_change
from rehab.people.models import LANGUAGES
from rehab.people.networks import client_address
from rehab.people.roles import Role
from rehab.people.sign_in import resets, step_up
from rehab.people.sign_in.factors import factors, passkeys
from rehab.people.sign_in.forms import NewPasswordForm


@for_roles(*Role, patients=False)
@never_cache
@require_safe
def show_account(request: HttpRequest) -> HttpResponse:
    """Show the account with its second factors and language."""
    user = user_of(request)
    context = {
        "owner": user,
        "languages": LANGUAGES,
        "authenticators": factors.authenticators_of(user),
        "is_required": factors.is_required(user),
        "codes_left": factors.count_recovery_codes(user),
        "passkeys": passkeys.are_supported(request),
        "resets": resets.requests_for(user, timezone.now()),
    }
    return render(request, "people/account.html", context)


@for_roles(*Role, patients=False)
@step_up.required
@require_POST
def confirm_reset(request: HttpRequest) -> HttpResponse:
    """Confirm that a host may reset how an account signs in."""
    user, now = user_of(request), timezone.now()
    which = request.POST.get("which", "")
    confirmed = resets.confirm_request(user, int(which) if which.isdecimal() else 0, now)
    if confirmed is not None:
        address = client_address(request)
        record_security_change(Act.RESET, user, confirmed.account, address, now)
        message = _("%(host)s may now reset %(account)s, once within an hour.")
        names = {"host": confirmed.asked_by, "account": confirmed.account}
        messages.success(request, message % names)
    return redirect("account")


@for_roles(*Role, patients=False)
@never_cache
@sensitive_post_parameters()
@require_http_methods(["GET", "HEAD", "POST"])
def change_password(request: HttpRequest) -> HttpResponse:
    """Change the own password. All other sessions of the account end."""
    user = user_of(request)
    form = NewPasswordForm(request, user, request.POST if request.method == "POST" else None)
    if form.is_valid():
        form.save()
        update_session_auth_hash(request, user)
        messages.success(request, _("Your password is changed."))
        return redirect("account")
    return render(request, "people/sign_in/new_password.html", {"form": form})
