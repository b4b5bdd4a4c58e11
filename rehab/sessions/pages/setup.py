"""The page that sets a session up."""

from __future__ import annotations

from django.contrib import messages
from django.core.exceptions import ValidationError
from django.forms.boundfield import BoundWidget
from django.http import HttpRequest, HttpResponse
from django.shortcuts import get_object_or_404, redirect, render
from django.urls import reverse
from django.utils import timezone
from django.utils.translation import gettext
from django.utils.translation import gettext_lazy as _
from django.views.decorators.http import require_http_methods

from rehab.feedback.clinic_valences import valences_of
from rehab.people.access import for_roles, user_of
from rehab.people.models import Patient
from rehab.people.roles import Role
from rehab.sessions.forms.initial import initial_choices, last_session
from rehab.sessions.forms.preset import save_preset
from rehab.sessions.forms.setup import SessionForm
from rehab.sessions.reports.summary import format_first_goal, load_point
from rehab.sessions.setup.option import Group
from rehab.sessions.setup.options import ANSWERS, options_of
from rehab.sessions.setup.presets import Preset
from rehab.sessions.setup.protocol_models import MeasureDefinition, Protocol
from rehab.sessions.setup.protocol_outline import (
    describe_end,
    outline_protocol,
    protocol_minutes,
)
from rehab.sessions.setup.sources import SIMULATED
from rehab.stations.builtin import first_station
from rehab.stations.tablets import has_tablet

# Where the person who set the session up may go next; unless asked, to the therapist's page where
# a tablet shows the patient's.
NEXT_PAGES = ("walk", "monitor")
# The headings of the part that says when page and robot answer.
HEADINGS = {
    Group.GOAL: _("Goal"),
    Group.FEEDBACK: _("Feedback on the patient’s page"),
    Group.ROBOT: _("Robot"),
}


@for_roles(Role.LEAD, Role.PT)
@require_http_methods(["GET", "HEAD", "POST"])
def set_up(request: HttpRequest, patient_id: int) -> HttpResponse:
    """Show the set-up, filled in like last time or from a preset; create the session.

    The form may also be stored as a preset.
    """
    user = user_of(request)
    patient = get_object_or_404(Patient.objects.visible_to(user), pk=patient_id)
    first_station(patient.clinic)
    presets = list(Preset.objects.visible_to(user).select_related("protocol"))
    chosen = next((one for one in presets if str(one.pk) == request.GET.get("preset")), None)
    wanted = request.POST.get("then")
    name = request.POST.get("preset_name", "").strip()
    if request.method == "POST":
        form = SessionForm(request.POST, patient=patient, by=user)
        if wanted == "preset":
            try:
                preset = save_preset(request.POST, patient, user, name)
            except ValidationError as problem:
                form.errors.clear()
                form.add_error(None, problem.messages)
            else:
                message = gettext("Saved as preset “%(name)s”. It is renamed or deleted in Admin.")
                messages.success(request, message % {"name": preset.name})
                return redirect(f"{reverse('setup', args=[patient.pk])}?preset={preset.pk}")
        elif (session := form.create()) is not None:
            usual = NEXT_PAGES[has_tablet(session.station, timezone.now())]
            return redirect(wanted if wanted in NEXT_PAGES else usual, session_id=session.pk)
    else:
        initial = initial_choices(patient, user) | (chosen.to_initial(user) if chosen else {})
        form = SessionForm(initial=initial, patient=patient, by=user)
    measures = {row.pk: row.to_rule() for row in MeasureDefinition.objects.visible_to(user)}
    measure = form.chosen_measure
    protocols = Protocol.objects.visible_to(user).prefetch_related("phases")
    targets = {
        row.pk: {"minutes": protocol_minutes(row), "wanted_hits": row.wanted_hits}
        for row in protocols
    }
    outlines = {row.pk: outline_protocol(row) for row in protocols}
    ends = {row.pk: describe_end(row) for row in protocols}
    sources, tried = _part_sources(form)
    last = last_session(patient, user)
    same = last if last and last.measure.slug == measure.slug else None  # by the same measure
    point = load_point(user, same) if same else None
    proposed = initial_choices(patient, user)
    context = {
        "patient": patient,
        "last": proposed,
        "first_goal": format_first_goal(user, last, proposed),
        "station": form.chosen_station,
        "has_tablet": has_tablet(form.chosen_station, timezone.now()),
        "is_repeated": last is not None,
        "last_goal": same and same.goal,
        "last_baseline": point and point.baseline and point.baseline.mean,
        "protocols": [
            (choice, outlines[choice.data["value"].value])
            for choice in sorted(form["protocol"], key=lambda choice: not choice.data["selected"])
        ],
        "sources": sources,
        "tried": tried,
        "is_trying": any(choice.data["selected"] for choice in tried),
        "form": form,
        "valences": valences_of(patient.clinic_id).values(),
        "targets": targets,
        "ends": ends,
        "measure": measure,
        "goal_format": f"{measure.goal_places}u",
        "measures": {
            key: {
                "unit": rule.unit,
                "step": rule.goal_step,
                "places": rule.goal_places,
                "better": gettext(rule.better),
                "goal": f"{rule.offered_goal:.{rule.goal_places}f}",
            }
            for key, rule in measures.items()
        },
        "answers": [
            (group, words, [(option, form[option.name]) for option in options_of(group)])
            for group, words in HEADINGS.items()
        ],
        "answers_changed": any(
            form[option.name].value() != option.default for option in options_of(*ANSWERS)
        ),
        "walking": [form[option.name] for option in options_of(Group.WALKING)],
        "presets": presets,
        "preset": chosen,
        "preset_name": name,
    }
    return render(request, "sessions/setup.html", context)


def _part_sources(form: SessionForm) -> tuple[list[BoundWidget], list[BoundWidget]]:
    """Return the choices of a source, and those that only try: of a person, the simulated ones."""
    sources: list[BoundWidget] = list(form["source"])
    if form.patient.simulated:
        return sources, []
    tried = [choice for choice in sources if choice.data["value"].startswith(SIMULATED)]
    return [choice for choice in sources if choice not in tried], tried
