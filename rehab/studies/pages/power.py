"""A study's power: by formula at once, then by simulation: started, watched, continued."""

from __future__ import annotations

import sys
from typing import Any

from django import forms
from django.core.exceptions import PermissionDenied
from django.http import HttpRequest, HttpResponse
from django.shortcuts import get_object_or_404, redirect, render
from django.utils import timezone
from django.utils.translation import gettext_lazy as _
from django.views.decorators.http import require_http_methods, require_POST

from rehab.people.access import for_roles, user_of
from rehab.people.models import User
from rehab.people.ranges import NumberField, WholeNumberField
from rehab.people.roles import Role
from rehab.sessions.live import runtime
from rehab.studies.models import Study
from rehab.studies.pages.planning import get_study
from rehab.studies.pages.refusals import refuse
from rehab.studies.power_runs import SIMULATIONS_MAX, PowerRun, plan_run, usual_settings
from rehab.studies.registration.size import size_of_study
from rehab.studies.results.drawing import outcome_label, outcome_unit
from rehab.training.measures import InvalidSetting


class PowerForm(forms.Form):
    """What a simulated study assumes: the effect of each arm, and how people differ."""

    participants = WholeNumberField(label=_("participants"), least=2, most=2000)
    sd_percent = NumberField(label=_("people differ by (SD, % of baseline)"))
    kept_percent = NumberField(label=_("share of it that washout keeps (%)"))
    dropout_percent = NumberField(label=_("leave before each visit (%)"))
    simulations = WholeNumberField(label=_("simulated studies"), least=1, most=SIMULATIONS_MAX)

    def __init__(self, *args: Any, study: Study, **options: Any) -> None:
        super().__init__(*args, **options)
        self.initial = usual_settings(study)
        self.arms = list(study.arms.all())
        for arm in self.arms:
            effect = self.initial["effects"].get(arm.code, 0.0)
            self.fields[f"effect_{arm.code}"] = NumberField(label=str(arm), initial=effect)

    @property
    def effects(self) -> list[Any]:
        """The fields of the arms' effects."""
        return [self[f"effect_{arm.code}"] for arm in self.arms]

    @property
    def assumptions(self) -> list[Any]:
        """All other fields."""
        return [self[name] for name in self.base_fields]

    def to_settings(self) -> dict[str, Any]:
        """Return what a run stores."""
        data = self.cleaned_data
        names = ("participants", "sd_percent", "kept_percent", "dropout_percent")
        effects = {arm.code: data[f"effect_{arm.code}"] for arm in self.arms}
        return {name: data[name] for name in names} | {"effects": effects}


def _get(user: User, study_id: int) -> Study:
    """Return a study that a user may plan. Raises Http404, PermissionDenied for a draft."""
    study = get_study(user, study_id)
    if study.is_draft and user.role != Role.LEAD:
        raise PermissionDenied
    return study


@for_roles(Role.LEAD, Role.RESEARCHER, patients=False)
@require_http_methods(["GET", "HEAD", "POST"])
def show_power(request: HttpRequest, study_id: int) -> HttpResponse:
    """Show what simulated studies found so far, and simulate more."""
    user, now = user_of(request), timezone.now()
    study = _get(user, study_id)
    form = PowerForm(request.POST or None, study=study)
    if request.method == "POST" and form.is_valid():
        try:
            run = plan_run(study, form.to_settings(), form.cleaned_data["simulations"], user, now)
        except InvalidSetting as problem:
            form.add_error(None, refuse(request, problem))
        else:
            begin(run)
            return redirect("study-power", study_id=study.pk)
    runs = PowerRun.objects.visible_to(user).filter(study=study)
    context = {
        "study": study,
        "form": form,
        "size": (size_of_study(study) or ("", ""))[1],
        "runs": [{"run": run, "works": run.is_working(now), "power": run.power} for run in runs],
        "outcome": outcome_label(study, study.primary_outcome),
        "unit": outcome_unit(study, study.primary_outcome),
    }
    return render(request, "studies/power.html", context)


@for_roles(Role.LEAD, Role.RESEARCHER, patients=False)
@require_POST
def go_on(request: HttpRequest, run_id: int) -> HttpResponse:
    """Continue a run that was interrupted."""
    user = user_of(request)
    run = get_object_or_404(PowerRun.objects.visible_to(user), pk=run_id)
    begin(run)
    return redirect("study-power", study_id=_get(user, run.study_id).pk)


def begin(run: PowerRun) -> None:
    """Start a process that simulates, unless one does already; it ends with the server."""
    live = runtime.peek()
    if live is None or run.is_done:
        return
    PowerRun.everywhere.filter(pk=run.pk).update(worked_at=timezone.now(), trouble="")
    command = [sys.executable, "-m", "garry_site", "studypower"]
    live.loop.call_soon_threadsafe(_start, live, run.pk, command)


def _start(live: runtime.Runtime, run_id: int, command: list[str]) -> None:
    name = f"power of run {run_id}"
    if name not in live.supervisor.children:
        live.supervisor.start(name, [*command, "--run", str(run_id), "--child"], once=True)
