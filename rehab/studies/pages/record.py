"""Pages of a study's record: what is asked of it, its checklists, its adverse events."""

from __future__ import annotations

from django.contrib import messages
from django.core.exceptions import PermissionDenied
from django.http import HttpRequest, HttpResponse
from django.shortcuts import get_object_or_404, redirect, render
from django.utils import timezone
from django.utils.translation import gettext as _
from django.utils.translation import override
from django.views.decorators.http import require_GET, require_http_methods

from rehab.people.access import for_roles, user_of
from rehab.people.audit import audit_log
from rehab.people.audit.audit_log import Act
from rehab.people.roles import Role
from rehab.people.row_values import read_key
from rehab.sessions.log import SessionEvent
from rehab.studies.blinding import must_not_know_arms
from rehab.studies.models import Study, StudyState
from rehab.studies.pages.planning import get_study
from rehab.studies.pages.refusals import refuse
from rehab.studies.participants import Enrollment
from rehab.studies.record.adverse_events import (
    AdverseEvent,
    arm_of,
    may_monitor,
    propose,
    record,
    report,
)
from rehab.studies.record.checklists import checklist_rows
from rehab.studies.record.forms import AdverseEventForm, FactsForm
from rehab.studies.registration.lifecycle import revise
from rehab.studies.results.drawing import write_table
from rehab.studies.results.harms_and_deviations import label_of
from rehab.studies.results.results import read_results
from rehab.training.measures import InvalidSetting

Proposed = dict[str, tuple[Enrollment, SessionEvent]]  # by the key of the log's entry


@for_roles(Role.LEAD, patients=False)
@require_http_methods(["GET", "HEAD", "POST"])
def edit_facts(request: HttpRequest, study_id: int) -> HttpResponse:
    """Ask what a registry, an ethics board and a journal want to know."""
    user = user_of(request)
    study = get_study(user, study_id)
    if study.state == StudyState.CLOSED:
        return redirect("study", study_id=study.pk)
    form = FactsForm(request.POST or None, study=study)
    if request.method == "POST" and form.is_valid():
        study.facts = form.facts
        try:
            if study.is_draft:
                study.save(update_fields=["facts"])
            else:
                revise(study, form.cleaned_data["reason"], user, timezone.now())
        except InvalidSetting as problem:
            form.add_error(None, refuse(request, problem))
        else:
            return redirect("study", study_id=study.pk)
    return render(request, "studies/facts.html", {"study": study, "form": form})


@for_roles(Role.LEAD, Role.PT, Role.RESEARCHER, patients=False)
@require_GET
def download_checklists(request: HttpRequest, study_id: int) -> HttpResponse:
    """Return SPIRIT, CONSORT, TIDieR and WHO's items as CSV, in English as they are sent."""
    user, now = user_of(request), timezone.now()
    study = get_study(user, study_id)
    if must_not_know_arms(study, user) or (study.is_draft and user.role != Role.LEAD):
        raise PermissionDenied
    audit_log.record(Act.EXPORT, user, about=f"{study.code} checklists.csv", now=now)
    with override("en"):
        results = read_results(study, now) if study.state == StudyState.CLOSED else None
        text = write_table(checklist_rows(study, results))
    response = HttpResponse(text, content_type="text/csv; charset=utf-8")
    response["Content-Disposition"] = f'attachment; filename="{study.code}-checklists.csv"'
    return response


@for_roles(Role.LEAD, Role.PT, Role.RESEARCHER, patients=False)  # by codes; audited here
@require_http_methods(["GET", "HEAD", "POST"])
def show_harms(request: HttpRequest, study_id: int) -> HttpResponse:
    """List adverse events: who treats judges and reports them, a monitor sees them by arm."""
    user, now = user_of(request), timezone.now()
    study = get_study(user, study_id)
    monitors = may_monitor(study, user)
    treats = user.role in {Role.LEAD, Role.PT} and not must_not_know_arms(study, user)
    if study.is_draft or not (monitors or treats):
        raise PermissionDenied
    proposed: Proposed = {}
    form = None
    if treats:
        proposed = {str(event.pk): (whose, event) for whose, event in propose(study)}
        data = request.POST.copy() if request.method == "POST" else None
        if data is not None and (chosen := proposed.get(str(data.get("entry")))):
            data["enrollment"] = str(chosen[0].pk)
        form = AdverseEventForm(data, study=study, by=user)
        if data is not None and _store(request, study, form, proposed):
            return redirect("study-harms", study_id=study.pk)
    audit_log.record(Act.VIEW, user, about=f"{study.code} adverse events", now=now)
    events = AdverseEvent.everywhere.filter(enrollment__study=study).order_by("-pk")
    related = ("enrollment__allocation", "entry__session__study_visit")
    shows_arm = monitors or study.state == StudyState.CLOSED
    context = {
        "study": study,
        "form": form,
        "by_arm": shows_arm,
        "proposed": [
            {"entry": event, "code": enrollment.code, "label": label_of(event.kind)}
            for enrollment, event in proposed.values()
        ],
        "events": [
            {
                "event": one,
                "label": label_of(one.entry.kind) if one.entry else one.what,
                "arm": arm_of(one) if shows_arm else "",
                "is_late": bool(one.due_at and not one.reported_at and one.due_at < now),
            }
            for one in events.select_related(*related)
        ],
    }
    return render(request, "studies/harms.html", context)


def _store(request: HttpRequest, study: Study, form: AdverseEventForm, proposed: Proposed) -> bool:
    """Store what was sent: a report, or a judgment. Return whether it was."""
    user, now = user_of(request), timezone.now()
    if "report" in request.POST:
        events = AdverseEvent.everywhere.filter(enrollment__study=study)
        report(get_object_or_404(events, pk=read_key(request.POST["report"])), now)
        return True
    wanted = request.POST.get("entry", "")
    if wanted and wanted not in proposed:
        messages.warning(request, _("This was judged already. Reload the page."))
        return True
    if not form.is_valid():
        return False
    form.instance.by = user
    form.instance.entry = proposed[wanted][1] if wanted else None
    try:
        record(form.instance, now)
    except InvalidSetting as problem:
        form.add_error(None, refuse(request, problem))
        return False
    return True
