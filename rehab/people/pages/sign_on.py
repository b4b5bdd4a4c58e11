"""Pages of the sign-on with the hospital's own accounts."""

from __future__ import annotations

from django.contrib import messages
from django.http import Http404, HttpRequest, HttpResponse
from django.shortcuts import redirect
from django.urls import reverse
from django.utils import timezone
from django.utils.translation import gettext as _
from django.views.decorators.cache import never_cache
from django.views.decorators.csrf import csrf_exempt
from django.views.decorators.http import require_POST, require_safe

from rehab.people.access import for_roles, public, user_of
from rehab.people.audit.audit_log import Act, record_security_change
from rehab.people.models import User
from rehab.people.pages.sign_in import go_on, landing_page
from rehab.people.roles import Role
from rehab.people.sign_in import sign_on, smart_launch, step_up, two_stage_sign_in


@public
@never_cache
@require_safe
def begin(request: HttpRequest) -> HttpResponse:
    """Lead a stranger to the hospital's sign-on."""
    return _lead_there(request, "sign-in", request.GET.get("next", ""), "sign-in")


@public
@never_cache
@require_safe
def launch(request: HttpRequest) -> HttpResponse:
    """Begin what a hospital's health record launches: a sign-on that opens its patient."""
    if not smart_launch.is_launch(request.GET.get("iss", "")):
        raise Http404
    return _lead_there(request, "launch", "", "sign-in")


@for_roles(*Role, patients=False)
@never_cache
@require_safe
def confirm(request: HttpRequest) -> HttpResponse:
    """Have a person sign in at the hospital anew, to show who it is."""
    return _lead_there(request, "confirm", request.GET.get("next", ""), "confirm")


@for_roles(*Role, patients=False)
@step_up.required
@require_POST
def link(request: HttpRequest) -> HttpResponse:
    """Link the own account with the one of the hospital, or end that."""
    user = user_of(request)
    if "end" not in request.POST:
        return _lead_there(request, "link", reverse("account"), "account")
    if not user.has_usable_password():
        messages.error(request, _("Without it nobody could sign in here. Ask your clinic’s lead."))
        return redirect("account")
    _set_subject(request, user, None)
    return redirect("account")


@public
@never_cache
@require_safe
def complete(request: HttpRequest) -> HttpResponse:
    """Receive what the hospital says of the person who comes back."""
    _check_configured()
    now = timezone.now()
    back = "account" if isinstance(request.user, User) else "sign-in"
    try:
        purpose, claims, token = sign_on.complete(request)
        next_url = purpose["next_url"]
        if purpose["kind"] in ("sign-in", "launch"):
            user = sign_on.find_account(claims)
            if purpose["kind"] == "launch":
                next_url = _open_patient(request, user, token)
            return _sign_in(request, user, claims, next_url)
        user = user_of(request)
        if purpose["kind"] == "link":
            if User.everywhere.filter(subject=claims["sub"]).exclude(pk=user.pk).exists():
                raise sign_on.SignOnRefused(_("Another account here has this hospital account."))
            _set_subject(request, user, claims["sub"])
        elif user.subject != claims["sub"] or not sign_on.was_shown_since(claims, purpose["at"]):
            raise sign_on.SignOnRefused(_("The hospital did not confirm that it is you."))
        else:
            step_up.confirm(request, now)
    except sign_on.SignOnRefused as refused:
        messages.error(request, str(refused))
        return redirect(back)
    return redirect(next_url if step_up.is_own_page(request, next_url) else "home")


@csrf_exempt  # the hospital's server sends it, signed
@public
@require_POST
def end(request: HttpRequest) -> HttpResponse:
    """End the sign-ins of an account that signed out, or was switched off, at the hospital."""
    _check_configured()
    try:
        sign_on.end_sign_ins(request.POST.get("logout_token", ""), timezone.now())
    except sign_on.SignOnRefused as refused:
        return HttpResponse(str(refused), status=400, content_type="text/plain")
    return HttpResponse(status=200)


def _lead_there(request: HttpRequest, kind: str, next_url: str, back: str) -> HttpResponse:
    _check_configured()
    returned = request.build_absolute_uri(reverse("sign-on-complete"))
    try:
        return sign_on.begin(request, kind, next_url, returned, timezone.now())
    except sign_on.SignOnRefused as refused:
        messages.error(request, str(refused))
        return redirect(back)


def _sign_in(
    request: HttpRequest, user: User, claims: dict[str, object], next_url: str
) -> HttpResponse:
    if not step_up.is_own_page(request, next_url):
        next_url = landing_page(user)
    if not sign_on.has_second_factor(claims):
        return go_on(request, user, next_url)
    two_stage_sign_in.finish(request, user, timezone.now(), second_factor_verified=True)
    return redirect(next_url)


def _open_patient(request: HttpRequest, user: User, token: dict[str, object]) -> str:
    """Return the address of the patient whom the record has open; "" where that is nobody here."""
    patient = smart_launch.find_patient(user, token)
    if patient is not None:
        return reverse("patient", args=[patient.pk])
    words = _("No patient here has the number of the one who is open in the hospital’s record.")
    messages.warning(request, words)
    return ""


def _set_subject(request: HttpRequest, user: User, subject: str | None) -> None:
    user.subject = subject
    user.save(update_fields=["subject"])
    record_security_change(Act.SIGN_ON, request, user, timezone.now())


def _check_configured() -> None:
    if not sign_on.is_configured():
        raise Http404
