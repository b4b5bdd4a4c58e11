"""Pages that list what is fixed by registering and by starting a study, and ask for a yes."""

from __future__ import annotations

from typing import Any

from django import forms
from django.db import transaction
from django.http import HttpRequest, HttpResponse
from django.shortcuts import redirect, render
from django.utils import timezone
from django.views.decorators.http import require_http_methods

from rehab.people.access import for_roles, user_of
from rehab.people.roles import Role
from rehab.people.web.refusals import format_refusal
from rehab.studies.models import Study, StudyMark, StudyState
from rehab.studies.pages.planning import compare_arms, get_study
from rehab.studies.pages.refusals import refuse
from rehab.studies.registration.document import describe
from rehab.studies.registration.estimands import METHOD, summary
from rehab.studies.registration.facts import ASKED, BEFORE
from rehab.studies.registration.lifecycle import current_version, register, start
from rehab.studies.registration.problems import Problem, find_doubts, find_problems
from rehab.studies.registration.protocol_pdf import plan_rows
from rehab.training.measures import InvalidSetting

STATES = {"register": StudyState.DRAFT, "start": StudyState.REGISTERED}


class DoubtsForm(forms.Form):
    """Asks the reason of each doubt. ``doubts``: of `find_doubts`."""

    def __init__(self, data: Any, doubts: dict[str, str]) -> None:
        super().__init__(data)
        for slug, words in doubts.items():
            area = forms.Textarea(attrs={"rows": 2})
            self.fields[slug] = forms.CharField(
                label=ASKED[slug], help_text=words, max_length=1000, widget=area
            )


@for_roles(Role.LEAD, patients=False)
@require_http_methods(["GET", "HEAD", "POST"])
def confirm_step(request: HttpRequest, study_id: int, step: str) -> HttpResponse:
    """Show what is fixed by a step, and take it once it is confirmed.

    Parameters
    ----------
    study_id
        Key of the study.
    step
        ``register`` or ``start``.
    """
    user, now = user_of(request), timezone.now()
    study = get_study(user, study_id)
    if study.state != STATES[step]:
        return redirect("study", study_id=study.pk)
    problems = _problems(study, step)
    data = request.POST if request.method == "POST" else None
    form = DoubtsForm(data, find_doubts(study) if not problems else {})
    if data is not None and not problems and form.is_valid():
        try:
            if step == "start":
                start(study, user, now, " ".join(form.cleaned_data.values()))
            else:
                with transaction.atomic():
                    study.facts |= form.cleaned_data
                    study.save(update_fields=["facts"])
                    register(study, user, now)
        except InvalidSetting as problem:
            problems = [Problem(refuse(request, problem), "")]
        else:
            return redirect("study", study_id=study.pk)
    fixed = {} if problems else _fixed(study)
    context = {"study": study, "step": step, "problems": problems, "form": form, **fixed}
    return render(request, "studies/confirm.html", context)


def _problems(study: Study, step: str) -> list[Problem]:
    if step == "register":
        return find_problems(study)
    try:
        current_version(study)
    except InvalidSetting as problem:
        return [Problem(format_refusal(problem), "")]
    return []


def _fixed(study: Study) -> dict[str, Any]:
    document = describe(study)
    assessors = study.marks.filter(task=StudyMark.Task.ASSESSOR, ended_at=None)
    return {
        **compare_arms(study),
        "plan": plan_rows(document),
        "model": f"{summary(document)} {METHOD}",
        "assessors": [mark.user for mark in assessors.select_related("user")],
        "unsaid": [(slug, ASKED[slug]) for slug in BEFORE if not study.facts.get(slug)],
    }
