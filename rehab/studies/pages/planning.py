"""Pages that list, plan, register and close studies, and give accounts marks in them."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from django.contrib import messages
from django.core.exceptions import PermissionDenied
from django.db import transaction
from django.db.models import Count
from django.http import HttpRequest, HttpResponse, JsonResponse
from django.shortcuts import get_object_or_404, redirect, render
from django.template.defaultfilters import floatformat
from django.utils import timezone
from django.utils.translation import gettext
from django.views.decorators.http import (
    require_GET,
    require_http_methods,
    require_POST,
    require_safe,
)

from rehab.people.access import clinic_of, for_roles, user_of
from rehab.people.models import User
from rehab.people.roles import Role, may_see_names
from rehab.people.row_values import read_key
from rehab.people.web.refusals import format_refusal
from rehab.studies.arm_forms import build_arm_forms, save_arms
from rehab.studies.arms import MAX_ARMS
from rehab.studies.blinding import MARKABLE, Task, give_mark, must_not_know_arms, take_mark
from rehab.studies.forms import StudyForm, save_draft
from rehab.studies.models import Study, StudyMark, StudyState
from rehab.studies.pages.refusals import log_refusal, refuse
from rehab.studies.participants import Allocation, Enrollment, Screening, StudyEvent, StudyVisit
from rehab.studies.record.adverse_events import may_monitor
from rehab.studies.registration.document import describe
from rehab.studies.registration.lifecycle import close, revise
from rehab.studies.registration.outcome_changes import first_primary, outcome_changes
from rehab.studies.registration.problems import UnfitPlan
from rehab.studies.registration.protocol_json import write_json
from rehab.studies.registration.protocol_pdf import plan_rows, write_pdf
from rehab.studies.results.reading import UNREAD
from rehab.studies.results.results import may_look
from rehab.studies.size_form import SizeForm
from rehab.studies.visit_marks import describe_visits
from rehab.studies.visits import next_visit
from rehab.training.measures import InvalidSetting


def get_study(user: User, study_id: int) -> Study:
    """Return the study of key ``study_id``. Raises Http404 if ``user`` may not see it."""
    return get_object_or_404(Study.objects.visible_to(user).select_related("clinic"), pk=study_id)


@for_roles(Role.LEAD, Role.PT, Role.RESEARCHER, Role.SPONSOR, patients=False)
@require_safe
def list_studies(request: HttpRequest) -> HttpResponse:
    """List the clinic's studies; only leads see drafts."""
    user = user_of(request)
    studies = Study.objects.visible_to(user).annotate(count=Count("enrollments"))
    if user.role != Role.LEAD:
        studies = studies.exclude(state=StudyState.DRAFT)
    return render(request, "studies/list.html", {"studies": studies})


@for_roles(Role.LEAD, patients=False)
@require_http_methods(["GET", "HEAD", "POST"])
def plan_study(request: HttpRequest, study_id: int | None = None) -> HttpResponse:
    """Plan a study; a registered one is changed by a new version, with a reason."""
    user = user_of(request)
    study = get_study(user, study_id) if study_id else Study(clinic=clinic_of(user))
    if study.state == StudyState.CLOSED:
        return redirect("study", study_id=study.pk)
    study.created_by = study.created_by or user
    data = request.POST if request.method == "POST" else None
    form = StudyForm(data, instance=study)
    arms = build_arm_forms(study, user, data)
    # Both, so that all errors are seen at once.
    if data is not None and all([form.is_valid(), arms.is_valid()]):
        try:
            if study.is_draft:
                study = save_draft(form, arms)
            else:
                with transaction.atomic():
                    save_arms(arms, study)
                    reason, again = (form.cleaned_data[n] for n in ("reason", "needs_consent"))
                    revise(study, reason, user, timezone.now(), needs_consent=again)
        except InvalidSetting as problem:
            _show_problems(form, arms, problem)
            if study_id is None:
                study.pk = None
        else:
            return redirect("study", study_id=study.pk)
    if data is not None:
        log_refusal(request)
    context = {
        "form": form,
        "arms": arms,
        "wrong": [field for one in (form, *arms.forms) for field in one if field.errors],
        "study": study if study_id else None,
        "outcomes": [(study.outcome_label(slug), one) for slug, one in study.outcomes.items()],
    }
    return render(request, "studies/form.html", context)


def _show_problems(form: StudyForm, arms: Any, problem: InvalidSetting) -> None:
    """Show each reason why a plan cannot be registered at the field that mends it."""
    if not isinstance(problem, UnfitPlan):
        form.add_error(None, format_refusal(problem))
        return
    filled = [one for one in arms.forms if one.instance.code and one not in arms.deleted_forms]
    for one in problem.problems:
        prefix, row, name = (*one.field.split("-"), "", "")[:3]
        if prefix == "arm" and int(row) < len(filled):
            filled[int(row)].add_error(name, one.words)
        else:
            form.add_error(one.field if one.field in form.fields else None, one.words)


@for_roles(Role.LEAD, patients=False)
@require_POST
def show_size(request: HttpRequest) -> HttpResponse:
    """Answer how many participants the plan needs that is being typed; nothing is stored."""
    sent = request.POST
    rows = [n for n in range(MAX_ARMS) if sent.get(f"arm-{n}-name")]
    weights = [read_key(sent.get(f"arm-{row}-weight", "")) or 1 for row in rows]
    form = SizeForm(sent)
    form.full_clean()
    try:
        words, participants = form.tell(weights if len(rows) > 1 else [1, 1])
    except InvalidSetting as problem:
        words, participants = format_refusal(problem), None
    return JsonResponse({"words": words, "participants": participants})


@for_roles(Role.LEAD, Role.PT, Role.RESEARCHER)
@require_safe
def show_study(request: HttpRequest, study_id: int) -> HttpResponse:
    """Show a study: its plan, participants and events. From assessors the arms are hidden."""
    user = user_of(request)
    study = get_study(user, study_id)
    if study.is_draft and user.role != Role.LEAD:
        raise PermissionDenied
    return render(request, "studies/study.html", study_context(study, user))


def study_context(study: Study, user: User) -> dict[str, Any]:
    """Return what the page of a study shows ``user``; from an assessor, the arms are hidden."""
    blind, is_lead = must_not_know_arms(study, user), user.role == Role.LEAD
    by_name, events = may_see_names(user.role), StudyEvent.objects.visible_to(user)
    return {
        "study": study,
        "blind": blind,
        "is_lead": is_lead,
        "by_name": by_name,
        "may_look": may_look(study, user),
        "may_plan": user.role in {Role.LEAD, Role.RESEARCHER},
        "may_see_harms": may_monitor(study, user) or user.role in {Role.LEAD, Role.PT},
        "may_treat": user.role in {Role.LEAD, Role.PT} and not blind,
        **({} if blind else compare_arms(study)),
        "participants": (people := _participants(study, user, blind=blind)),
        "has_simulated": any(one["has_simulated"] for one in people),
        "primary": study.outcome_label(first_primary(study)),
        "plan": () if blind else _plan(study),
        "changes": outcome_changes(study),
        "versions": study.versions.all(),
        "events": () if blind else events.filter(study=study).select_related("by"),
        "screened": Screening.objects.visible_to(user)
        .filter(study=study)
        .select_related("patient"),
        "marks": study.marks.filter(ended_at=None).select_related("user") if is_lead else (),
        "tasks": _markable(study) if is_lead else (),
    }


def compare_arms(study: Study) -> dict[str, Any]:
    """Return the columns in which the arms differ, with each arm's values, and what is alike."""
    arms = list(study.arms.select_related("measure", "protocol"))
    facts: list[tuple[str, list[object]]] = [
        (gettext("Feedback"), [arm.get_valence_display() for arm in arms]),
        (gettext("Feedback comes"), [arm.feedback_schedule for arm in arms]),
        (gettext("Gain"), [floatformat(arm.gain, -2) for arm in arms]),
        (gettext("Robot"), [arm.get_robot_intensity_display() for arm in arms]),
        (gettext("Measure"), [arm.measure for arm in arms]),
        (gettext("Protocol"), [arm.protocol for arm in arms]),
        (gettext("Ratio"), [arm.weight for arm in arms]),
    ]
    differ = [(name, values) for name, values in facts if len(set(map(str, values))) > 1]
    alike = [(name, values[0]) for name, values in facts if len(set(map(str, values))) == 1]
    return {
        "arm_columns": [name for name, _values in differ],
        "arms": [(arm, [values[row] for _name, values in differ]) for row, arm in enumerate(arms)],
        "arms_alike": alike,
    }


def _plan(study: Study) -> list[tuple[object, ...]]:
    """Return the plan as it is registered, of a draft as it would be; nothing if it could not."""
    version = study.versions.last()
    try:
        return plan_rows(version.document if version else describe(study))
    except InvalidSetting:
        return []


def _participants(study: Study, user: User, *, blind: bool) -> list[dict[str, Any]]:
    """Return the participants that a user may see; groups only once the study is closed."""
    rows = Enrollment.objects.visible_to(user).filter(study=study).select_related("patient")
    groups: dict[int, str] = {}
    if study.state == StudyState.CLOSED:
        allocations = Allocation.objects.visible_to(user).filter(enrollment__study=study)
        groups = dict(allocations.values_list("enrollment_id", "group"))
    enrollments = list(rows.order_by("pk"))
    of_study = StudyVisit.everywhere.filter(enrollment__in=enrollments)
    visits = list(of_study.select_related("session", "enrollment__patient").defer(*UNREAD))
    told = describe_visits(study, visits, blind=blind)
    of_each: dict[int, list[StudyVisit]] = {row.pk: [] for row in enrollments}
    for visit in visits:
        of_each[visit.enrollment_id].append(visit)
    return [
        {
            "enrollment": row,
            "next": next_visit(row),
            "group": groups.get(row.pk, ""),
            "told": [(visit, told[visit.pk]) for visit in of_each[row.pk] if told.get(visit.pk)],
            "has_simulated": any(visit.is_simulated for visit in of_each[row.pk]),
        }
        for row in enrollments
    ]


def _markable(study: Study) -> list[tuple[str, Any, Any, list[User]]]:
    """Return the marks that a lead can give, and whom each could be given to."""
    people = User.everywhere.filter(clinic=study.clinic_id, is_active=True).order_by("username")
    found = []
    for task, role in MARKABLE.items():
        marked = study.marks.filter(task=task, ended_at=None).values("user")
        found.append(
            (
                task.value,
                task.label,
                role.label,
                list(people.filter(role=role).exclude(pk__in=marked)),
            )
        )
    return found


@for_roles(Role.LEAD, patients=False)
@require_POST
def close_study(request: HttpRequest, study_id: int) -> HttpResponse:
    """Close a study."""
    user = user_of(request)
    study = get_study(user, study_id)
    _try(request, lambda: close(study, user, timezone.now()))
    return redirect("study", study_id=study.pk)


@for_roles(Role.LEAD, patients=False)
@require_POST
def change_marks(request: HttpRequest, study_id: int) -> HttpResponse:
    """Change who is an assessor, and who may look before the end."""
    user, now = user_of(request), timezone.now()
    study = get_study(user, study_id)
    if "take" in request.POST:
        mark = get_object_or_404(StudyMark, study=study, pk=read_key(request.POST["take"]))
        take_mark(mark, user, now)
    else:
        people = User.objects.visible_to(user)
        person = get_object_or_404(people, pk=read_key(request.POST.get("user", "")))
        task = request.POST.get("task", "")
        if task in Task.values:
            _try(request, lambda: give_mark(study, person, Task(task), user, now))
    return redirect("study", study_id=study.pk)


@for_roles(Role.LEAD, Role.PT, Role.RESEARCHER, patients=False)
@require_GET
def download_protocol(request: HttpRequest, study_id: int, kind: str) -> HttpResponse:
    """Return the registered study with all its versions, as a file.

    Parameters
    ----------
    study_id
        Key of the study.
    kind
        ``json``, or ``pdf`` for a document to print.
    """
    user = user_of(request)
    study = get_study(user, study_id)
    if must_not_know_arms(study, user) or study.is_draft:
        raise PermissionDenied
    content: str | bytes = write_pdf(study) if kind == "pdf" else write_json(study)
    response = HttpResponse(content, content_type=f"application/{kind}")
    response["Content-Disposition"] = f'attachment; filename="{study.code}-protocol.{kind}"'
    return response


def _try(request: HttpRequest, act: Callable[[], Any]) -> None:
    """Do something, or show why it cannot be done."""
    try:
        act()
    except InvalidSetting as problem:
        messages.error(request, refuse(request, problem))
