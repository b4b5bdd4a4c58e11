"""The page of an account's own sign-ins, and of the browsers in which it is signed in."""

from __future__ import annotations

from django.contrib import messages
from django.contrib.auth import logout
from django.http import HttpRequest, HttpResponse
from django.shortcuts import redirect, render
from django.utils import timezone
from django.utils.translation import gettext as _
from django.views.decorators.cache import never_cache
from django.views.decorators.http import require_POST, require_safe

from rehab.people.access import for_roles, user_of
from rehab.people.audit import audit_log
from rehab.people.audit.audit_log import SIGN_IN_ACTS, Act, AuditEntry
from rehab.people.networks import client_address
from rehab.people.roles import Role
from rehab.people.sign_in import devices

SHOWN = 50  # the newest


@for_roles(*Role, patients=False)
@never_cache
@require_safe
def show_sign_ins(request: HttpRequest) -> HttpResponse:
    """Show where the account is signed in, and what was done and tried with it lately."""
    user = user_of(request)
    # Everybody reads what was done in the own name, also who reads no other line of the log.
    trace = AuditEntry.everywhere.filter(by=user, act__in=SIGN_IN_ACTS).order_by("-at", "-pk")
    context = {
        "browsers": devices.browsers_of(user, request, timezone.now()),
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
