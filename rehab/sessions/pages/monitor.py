"""The PT's page of a running session, and the notes that are typed there."""

from __future__ import annotations

from csp.constants import SELF
from csp.decorators import csp_replace
from django.contrib import messages
from django.http import HttpRequest, HttpResponse, JsonResponse
from django.shortcuts import get_object_or_404, redirect, render
from django.urls import reverse
from django.utils import timezone
from django.utils.text import capfirst
from django.utils.translation import gettext as _
from django.utils.translation import pgettext_lazy
from django.views.decorators.clickjacking import xframe_options_sameorigin
from django.views.decorators.http import require_POST, require_safe

from rehab.people.access import for_roles, user_of
from rehab.people.consent.services import is_remote_view_allowed
from rehab.people.models import Patient
from rehab.people.networks import client_address
from rehab.people.roles import Role
from rehab.people.row_values import read_key
from rehab.sessions.control_text import chart_marks
from rehab.sessions.corrections import add_note
from rehab.sessions.log import EVENTS, FallSeverity, Remark
from rehab.sessions.models import TrainingSession
from rehab.sessions.reports.remarks import ICONS
from rehab.sessions.setup.options import OPTIONS
from rehab.sessions.setup.walking_conditions import BELT_M_S, SUPPORT_PERCENT
from rehab.training.changes import OPEN_STATES
from rehab.training.plans import ROBOT_LEVELS

NOTE_MAX_CHARS = 500
RATING_MAX = 10  # of exertion and pain
# What helps, as short as a button's word has to be.
ASSISTANCE_SHORT = {
    Remark.WALKING_AID: pgettext_lazy("what helps to walk", "Aid"),
    Remark.ORTHOSIS: pgettext_lazy("what helps to walk", "Orthosis"),
    Remark.HANDRAIL: pgettext_lazy("what helps to walk", "Rail"),
    Remark.HELPING_HAND: pgettext_lazy("what helps to walk", "Hand"),
}


def redirect_to_consent(request: HttpRequest, patient: Patient) -> HttpResponse:
    """Redirect a user outside the clinic to the page where remote view is consented to."""
    message = _(
        "You are not in the clinic, and %(patient)s has not agreed to remote view. Ask first, and "
        "note it here."
    )
    messages.error(request, message % {"patient": patient.nickname})
    return redirect("consent", patient_id=patient.pk)


@for_roles(Role.LEAD, Role.PT)
@xframe_options_sameorigin  # two of them stand side by side
@csp_replace({"frame-ancestors": [SELF]})  # type: ignore[arg-type]  # knows no views with arguments
@require_safe
def show_monitor(request: HttpRequest, session_id: int) -> HttpResponse:
    """Show the page that controls a session; its contents come by the session's socket."""
    sessions = TrainingSession.objects.visible_to(user_of(request))
    session = get_object_or_404(
        sessions.select_related("patient__clinic", "station", "measure"), pk=session_id
    )
    if not is_remote_view_allowed(session.patient, client_address(request)):
        return redirect_to_consent(request, session.patient)
    context = {
        "chart_marks": chart_marks(),
        "session": session,
        "whom": session.patient.nickname if "beside" in request.GET else "",
        "locked": session.to_plan().locked,
        "alarms_elsewhere": f"?but={session.pk}&station={session.station_id or 0}",
        "remarks": [
            {"slug": what.value, "label": capfirst(EVENTS[what]), "icon": icon}
            for what, icon in ICONS.items()
        ],
        "ratings": range(RATING_MAX + 1),
        "steppers": [
            (Remark.BELT_SPEED.value, _("Belt"), "m/s", 0.05, BELT_M_S[1]),
            (Remark.WEIGHT_SUPPORT.value, _("Support"), "%", 5, SUPPORT_PERCENT[1]),
        ],
        "assistance": [(what.value, short) for what, short in ASSISTANCE_SHORT.items()],
        "adaptations": OPTIONS["goal_follows"].choices,
        "severities": [(one.value, capfirst(one.label), one.meaning) for one in FallSeverity],
        "levels": [(capfirst(_(name)), share) for name, share in ROBOT_LEVELS.items()],
    }
    return render(request, "sessions/monitor.html", context)


@for_roles(Role.LEAD, Role.PT)
@require_POST
def write_note(request: HttpRequest, session_id: int) -> JsonResponse:
    """Add a line to a session's note; who it names is erased with the patient."""
    user = user_of(request)
    session = get_object_or_404(TrainingSession.objects.visible_to(user), pk=session_id)
    line = request.POST.get("note", "").strip()
    if not 0 < len(line) <= NOTE_MAX_CHARS:
        message = _("Write a note of up to %(count)s letters.") % {"count": NOTE_MAX_CHARS}
        return JsonResponse({"message": message}, status=400)
    add_note(session, line, user, timezone.now())
    return JsonResponse({"message": _("Noted: %(what)s") % {"what": line}})


@for_roles(Role.LEAD, Role.PT)
@require_safe
def show_side_by_side(request: HttpRequest) -> HttpResponse:
    """Show the pages of two open sessions at once, each with its own Stop.

    ``of``: their keys; else the two that were set up last, at two stations. One alone is shown on
    its own page, which says that there is no second one.
    """
    states = [state.value for state in OPEN_STATES]
    rows = TrainingSession.objects.visible_to(user_of(request)).filter(state__in=states)
    rows = rows.select_related("patient", "station").order_by("-created_at", "-pk")
    wanted = [key for text in request.GET.getlist("of") if (key := read_key(text))]
    if wanted:
        rows = rows.filter(pk__in=wanted)
    shown: dict[int, TrainingSession] = {}
    for session in rows:
        shown.setdefault(session.station_id or -session.pk, session)
    two = sorted(list(shown.values())[:2], key=lambda session: str(session.station))
    if len(two) == 1:
        return redirect(reverse("monitor", args=[two[0].pk]) + "?second=none")
    shown_here = "?" + "&".join(f"but={session.pk}" for session in two)
    context = {"sessions": two, "alarms_elsewhere": shown_here if two else ""}
    return render(request, "sessions/side_by_side.html", context)
