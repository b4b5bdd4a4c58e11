"""Planning and removing visits."""

from __future__ import annotations

from datetime import timedelta

from django.contrib import messages
from django.http import HttpRequest, HttpResponse
from django.shortcuts import redirect
from django.utils import timezone
from django.utils.dateformat import format as format_date
from django.utils.translation import gettext as _
from django.utils.translation import ngettext
from django.views.decorators.http import require_POST

from rehab.patients.visits import (
    QUICK_VISIT_DAYS,
    InvalidVisitDay,
    Visit,
    parse_day,
    parse_weeks,
    plan_visit,
    suggested_time,
)
from rehab.people.access import for_roles, get_patient, user_of
from rehab.people.roles import Role
from rehab.people.row_values import read_key
from rehab.sessions.formatting import clinic_time


@for_roles(Role.LEAD, Role.PT)
@require_POST
def change_visits(request: HttpRequest, patient_id: int) -> HttpResponse:
    """Plan visits (``in``: days from today; or ``day``, ``at``, ``weeks``), or ``remove`` one."""
    user = user_of(request)
    patient = get_patient(user, patient_id)
    visits = Visit.objects.visible_to(user).filter(patient=patient)
    given = request.POST
    if removed := read_key(given.get("remove", "")):
        visits.filter(pk=removed).delete()
        return redirect("patient", patient_id=patient.pk)
    now = clinic_time(timezone.now(), patient.clinic)
    try:
        if (days := given.get("in", "")) in map(str, QUICK_VISIT_DAYS):
            day = now.date() + timedelta(days=int(days))
            at = suggested_time(user, patient, now) if int(days) else None
        else:
            day, at = parse_day(given.get("day", ""), given.get("at", ""), now.date())
        weeks = parse_weeks(given.get("weeks", "1"))
    except InvalidVisitDay as problem:
        messages.error(request, str(problem))
    else:
        visit, *_later = [
            plan_visit(patient, day + timedelta(weeks=week), at) for week in range(weeks)
        ]
        when = format_date(visit.day, _("l j F")) + (f", {visit.at:%H:%M}" if visit.at else "")
        names = {"name": patient.nickname, "when": when, "count": weeks}
        message = ngettext(
            "%(name)s is expected on %(when)s.",
            "%(name)s is expected on %(when)s, and each week after it: %(count)s visits.",
            weeks,
        )
        messages.success(request, message % names)
    return redirect("patient", patient_id=patient.pk)
