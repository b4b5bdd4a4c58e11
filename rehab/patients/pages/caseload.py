"""The caseload: who comes, who is stuck, who improves, who is due."""

from __future__ import annotations

from django.http import HttpRequest, HttpResponse
from django.shortcuts import render
from django.utils import timezone
from django.views.decorators.http import require_safe

from rehab.patients.caseload import FLAGS, load_caseload
from rehab.people.access import clinic_of, for_roles, user_of
from rehab.people.roles import Role
from rehab.sessions.formatting import clinic_time


@for_roles(Role.LEAD, Role.PT)
@require_safe
def show_caseload(request: HttpRequest) -> HttpResponse:
    """List the clinic's patients with what a therapist has to think of; ``?only=`` a flag."""
    user = user_of(request)
    now = clinic_time(timezone.now(), clinic_of(user))
    cases = load_caseload(user, now)
    only = request.GET.get("only", "")
    only = only if only in FLAGS else ""
    context = {
        "today": now.date(),
        "cases": [
            (case, case.tell(now.date())) for case in cases if not only or only in case.flags
        ],
        "only": only,
        "chips": [
            (flag, label, count)
            for flag, label in {"": "", **FLAGS}.items()
            if (count := sum(not flag or flag in case.flags for case in cases)) or flag == only
        ],
    }
    return render(request, "patients/caseload.html", context)
