"""Pages of the own account: password, language, sign-ins, and the browsers signed in."""

from __future__ import annotations

from django.contrib import messages
from django.contrib.auth import logout, update_session_auth_hash
from django.http import HttpRequest, HttpResponse
from django.shortcuts import redirect, render
from django.utils import timezone, translation
from django.utils.translation import gettext as _
from django.views.decorators.cache import never_cache
from django.views.decorators.debug import sensitive_post_parameters
from django.views.decorators.http import require_http_methods, require_POST, require_safe

from rehab.people.access import for_roles, user_of
from rehab.people.audit import audit_log
from rehab.people.audit.audit_log import SIGN_IN_ACTS, Act, AuditEntry, record_security_change
from rehab.people.models import LANGUAGES
from rehab.people.networks import client_address
from rehab.people.roles import Role
from rehab.people.row_values import read_key
from rehab.people.sign_in import resets, sign_on, signed_in_browsers, step_up
from rehab.people.sign_in.factors import factors, passkeys
from rehab.people.sign_in.forms import NewPasswordForm
from rehab.people.web.language import language_of

SHOWN = 50  # the newest entries


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
        "sign_on": sign_on.button_text(),
    }
    return render(request, "people/account.html", context)


@for_roles(*Role, patients=False)
@step_up.required
@require_POST
def confirm_reset(request: HttpRequest) -> HttpResponse:
    """Confirm that a host may reset how an account signs in."""
    user, now = user_of(request), timezone.now()
    confirmed = resets.confirm_request(user, read_key(request.POST.get("which", "")), now)
    if confirmed is not None:
        record_security_change(Act.RESET, request, confirmed.account, now)
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


@for_roles(*Role)
@require_POST
def choose_language(request: HttpRequest) -> HttpResponse:
    """Set the language of the own account; "" for the clinic's."""
    user = user_of(request)
    chosen = request.POST.get("language", "")
    if chosen not in {"", *dict(LANGUAGES)}:
        messages.error(request, _("There is no such language. Choose one of the list."))
        return redirect("account")
    user.language = chosen
    user.save(update_fields=["language"])
    with translation.override(language_of(user) or None):
        messages.success(request, _("Your pages are in this language now."))
    return redirect("account")


@for_roles(*Role, patients=False)
@never_cache
@require_safe
def show_sign_ins(request: HttpRequest) -> HttpResponse:
    """Show where the account is signed in, and what was done and tried with it lately."""
    user = user_of(request)
    # Everybody reads what was done in the own name, also who reads no other line of the log.
    trace = AuditEntry.everywhere.filter(by=user, act__in=SIGN_IN_ACTS).order_by("-at", "-pk")
    context = {
        "browsers": signed_in_browsers.browsers_of(user, request, timezone.now()),
        "trace": trace[:SHOWN],
    }
    return render(request, "people/sign_ins.html", context)


@for_roles(*Role, patients=False)
@require_POST
def end_sign_ins(request: HttpRequest) -> HttpResponse:
    """End all sign-ins of the account, this one as well."""
    user, now = user_of(request), timezone.now()
    audit_log.record(Act.SIGN_INS_ENDED, user, address=client_address(request), now=now)
    user.end_sign_ins()
    logout(request)
    messages.success(request, _("All sign-ins of this account have ended, this one as well."))
    return redirect("sign-in")
