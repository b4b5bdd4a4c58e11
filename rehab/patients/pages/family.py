"""The family's page, and the therapist's page of the links to it."""

from __future__ import annotations

import time

import segno
from django.contrib import messages
from django.http import HttpRequest, HttpResponse
from django.shortcuts import get_object_or_404, redirect, render
from django.urls import reverse
from django.utils import timezone
from django.utils.translation import gettext as _
from django.views.decorators.csrf import csrf_exempt
from django.views.decorators.http import require_http_methods, require_POST

from rehab.patients.family import (
    NOT_AGREED,
    WEEKS,
    FamilyLink,
    FamilyLinkRefused,
    end_link,
    find_link,
    give_link,
    note_opening,
    refusal_reason,
)
from rehab.patients.visits import next_visit
from rehab.people.access import for_roles, get_patient, public, user_of
from rehab.people.models import Patient
from rehab.people.networks import client_address
from rehab.people.roles import Role
from rehab.people.sign_in import step_up
from rehab.people.token_buckets import TokenBuckets
from rehab.people.web.language import activate_patient_language
from rehab.sessions.formatting import clinic_time
from rehab.sessions.reports.patient_summary import describe_for_family

# Of each address, in each server: a family shares one, and whoever guesses needs 2^255 tries.
limit = TokenBuckets(burst=20, interval_s=3.0)
HEADERS = {
    "Cache-Control": "no-store",
    "Referrer-Policy": "no-referrer",
    "X-Robots-Tag": "noindex, nofollow, noarchive",
}


@public
@csrf_exempt  # it changes nothing, and who has the link needs no cookie
@require_http_methods(["GET", "HEAD", "POST"])
def show_family(request: HttpRequest, token: str) -> HttpResponse:
    """Show how a patient's training goes to who has the link and taps a button.

    The first page has nothing but the button: programs that send links along open them as well,
    to draw a preview.
    """
    wait_s = limit.take(client_address(request), time.monotonic())
    now = timezone.now()
    link = None if wait_s else find_link(token, now)
    if link is not None:
        activate_patient_language(link.patient)
    context: dict[str, object] = {"link": link, "is_busy": bool(wait_s)}
    if link is not None and request.method == "POST":
        note_opening(link, client_address(request), now)
        local = clinic_time(now, link.patient.clinic)
        context |= {
            "patient": link.patient,
            "summary": describe_for_family(link.patient, local),
            "visit": next_visit(link.patient.pk, local),
            "today": local.date(),
        }
    status = 429 if wait_s else 404 if link is None else 200
    response = render(request, "patients/family.html", context, status=status)
    for name, value in HEADERS.items():
        response[name] = value
    if wait_s:
        response["Retry-After"] = str(int(wait_s) + 1)
    return response


@for_roles(Role.LEAD, Role.PT)
@step_up.required
@require_http_methods(["GET", "HEAD", "POST"])
def show_links(request: HttpRequest, patient_id: int) -> HttpResponse:
    """Show a patient's links; a POST gives a new one, which this answer alone shows."""
    patient = get_patient(user_of(request), patient_id)
    if request.method != "POST":
        return _render_links(request, patient)
    weeks = request.POST.get("weeks", "")
    try:
        token = give_link(
            patient,
            int(weeks) if weeks.isdecimal() and len(weeks) < 4 else 0,
            user_of(request),
            client_address(request),
            timezone.now(),
            shows_name=request.POST.get("name") == "yes",
        )
    except FamilyLinkRefused as refused:
        messages.error(request, str(refused))
        return redirect("family-links", patient_id=patient.pk)
    address = request.build_absolute_uri(reverse("family", kwargs={"token": token}))
    drawing = segno.make(address, micro=False).svg_inline(omitsize=True, border=2)
    return _render_links(request, patient, address=address, qr=drawing)


def _render_links(request: HttpRequest, patient: Patient, **given: str) -> HttpResponse:
    now = timezone.now()
    rows = FamilyLink.objects.visible_to(user_of(request)).filter(patient=patient)
    reason = refusal_reason(patient)
    context = {
        "patient": patient,
        "links": [(link, link.is_over(now)) for link in rows.select_related("created_by")[:20]],
        "refusal_reason": reason,
        "may_ask": reason == str(NOT_AGREED),
        "weeks": WEEKS,
        **given,
    }
    return render(request, "patients/family_links.html", context)


@for_roles(Role.LEAD, Role.PT)
@require_POST
def end_family_link(request: HttpRequest, link_id: int) -> HttpResponse:
    """End a link at once."""
    user = user_of(request)
    link = get_object_or_404(
        FamilyLink.objects.visible_to(user).select_related("patient"), pk=link_id
    )
    end_link(link, user, client_address(request), timezone.now())
    messages.success(request, _("The link shows nothing any more."))
    return redirect("family-links", patient_id=link.patient_id)
