"""The PT's page of a running session."""

from __future__ import annotations

from django.http import HttpRequest, HttpResponse
from django.shortcuts import get_object_or_404, render
from django.utils.translation import gettext_lazy as _
from django.views.decorators.http import require_safe

from rehab.people.access import for_roles, person
from rehab.people.roles import Role
from rehab.sessions.live.messages import BORG_MAX
from rehab.sessions.models import Remark, TrainingSession
from rehab.training.plans import ROBOT_LEVELS

# What is noted with one tap, with its icon.
ICONS = {
    Remark.REST: (_("Rest"), "rest"),
    Remark.PAIN: (_("Pain"), "pain"),
    Remark.DIZZINESS: (_("Dizziness"), "dizzy"),
    Remark.NEAR_FALL: (_("Near fall"), "nearfall"),
    Remark.FALL: (_("Fall"), "fall"),
    Remark.HANDRAIL: (_("Handrail"), "rail"),
    Remark.VERBAL_CUE: (_("Verbal cue"), "voice"),
    Remark.BORG: (_("Borg"), "borg"),
}
REMARKS = [
    {"slug": what.value, "label": label, "icon": icon} for what, (label, icon) in ICONS.items()
]
LEVELS = {"normal": _("Normal"), "gentle": _("Gentle"), "off": _("Off")}


@for_roles(Role.LEAD, Role.PT)
@require_safe
def show_monitor(request: HttpRequest, session_id: int) -> HttpResponse:
    """Show and steer a session; everything on it comes by its socket."""
    sessions = TrainingSession.objects.visible_to(person(request))
    session = get_object_or_404(
        sessions.select_related("patient", "station", "measure"), pk=session_id
    )
    context = {
        "session": session,
        "remarks": REMARKS,
        "borg": range(BORG_MAX + 1),
        "levels": [(LEVELS[name], share) for name, share in ROBOT_LEVELS.items()],
    }
    return render(request, "sessions/monitor.html", context)
