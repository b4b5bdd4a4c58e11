"""Notes that are typed while a session runs."""

from __future__ import annotations

from django.http import HttpRequest, JsonResponse
from django.shortcuts import get_object_or_404
from django.utils import timezone
from django.utils.translation import gettext as _
from django.views.decorators.http import require_POST

from rehab.people.access import for_roles, user_of
from rehab.people.roles import Role
from rehab.sessions.corrections import add_note
from rehab.sessions.models import TrainingSession

MAX_CHARS = 500


@for_roles(Role.LEAD, Role.PT)
@require_POST
def write_note(request: HttpRequest, session_id: int) -> JsonResponse:
    """Add a line to a session's note; who it names is erased with the patient."""
    user = user_of(request)
    session = get_object_or_404(TrainingSession.objects.visible_to(user), pk=session_id)
    line = request.POST.get("note", "").strip()
    if not 0 < len(line) <= MAX_CHARS:
        message = _("Write a note of up to %(count)s letters.") % {"count": MAX_CHARS}
        return JsonResponse({"message": message}, status=400)
    add_note(session, line, user, timezone.now())
    return JsonResponse({"message": _("Noted: %(what)s") % {"what": line}})
