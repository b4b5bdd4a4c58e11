"""Standard tests of a patient: the list with each course, and a page for each test."""

from __future__ import annotations

from typing import Any

from django import forms
from django.contrib import messages
from django.core.exceptions import ValidationError
from django.http import Http404, HttpRequest, HttpResponse
from django.shortcuts import redirect, render
from django.utils import timezone
from django.utils.translation import gettext
from django.utils.translation import gettext_lazy as _
from django.views.decorators.http import require_http_methods, require_POST, require_safe

from rehab.people.access import for_roles, get_patient, user_of
from rehab.people.ranges import NumberField
from rehab.people.roles import Role
from rehab.people.row_values import read_key
from rehab.people.web.refusals import format_refusal
from rehab.questionnaires.clinical_tests import (
    CLINICAL_TESTS,
    LAP_TEST_S,
    ClinicalTest,
    Way,
    to_speed,
)
from rehab.sessions.assessments import Assessment, format_result, load_courses
from rehab.sessions.setup.walking import MAX_DEVICE_LETTERS
from rehab.training.measures import InvalidSetting

USUAL_METERS = 10.0


class AssessmentForm(forms.Form):
    """The result of a test, as it is measured; a speed follows from distance and time."""

    def __init__(self, *args: Any, test: ClinicalTest, **options: Any) -> None:
        super().__init__(*args, **options)
        self.label_suffix = ""
        self.test = test
        if test.way is Way.SPEED:
            self.fields["meters"] = NumberField(
                label=_("Timed distance, m"),
                initial=f"{USUAL_METERS:g}",
                least=1,
                most=100,
                unit="m",
            )
            self.fields["measured"] = NumberField(label=_("Time, s"), least=0.5, most=600, unit="s")
        elif test.levels:
            levels = [
                (str(level), f"{level} · {_(words)}") for level, words in enumerate(test.levels)
            ]
            self.fields["measured"] = forms.ChoiceField(
                label=_("Category"), choices=levels, widget=forms.RadioSelect
            )
        else:
            labels = {
                Way.LAPS: _("Distance, m"),
                Way.STOPWATCH: _("Time, s"),
                Way.SCORE: _("Total"),
            }
            self.fields["measured"] = NumberField(
                label=labels[test.way], least=test.least, most=test.most, unit=test.unit
            )
        self.fields["device"] = forms.CharField(
            label=_("Walking aid, orthosis, help (if any)"),
            required=False,
            max_length=MAX_DEVICE_LETTERS,
        )

    def clean(self) -> dict[str, Any]:
        """Return the data with the ``value`` of the result. Refuses what the test cannot have."""
        data: dict[str, Any] = super().clean() or {}
        measured, meters = data.get("measured"), data.get("meters")
        if measured is None or (self.test.way is Way.SPEED and meters is None):
            return data
        try:
            value = to_speed(meters, measured) if meters is not None else float(measured)
            self.test.check(value)
        except InvalidSetting as problem:
            raise ValidationError(format_refusal(problem)) from problem
        return data | {"value": value}


@for_roles(Role.LEAD, Role.PT)
@require_safe
def list_assessments(request: HttpRequest, patient_id: int) -> HttpResponse:
    """Show every standard test with a patient's results and their course."""
    user = user_of(request)
    patient = get_patient(user, patient_id)
    courses = load_courses(user, patient)
    context = {"patient": patient, "courses": courses, "none": not any(c.results for c in courses)}
    return render(request, "sessions/assessments.html", context)


@for_roles(Role.LEAD, Role.PT)
@require_http_methods(["GET", "HEAD", "POST"])
def assess(request: HttpRequest, patient_id: int, slug: str) -> HttpResponse:
    """Take a test: what to do, the stopwatch, and the result."""
    user = user_of(request)
    patient, test = get_patient(user, patient_id), CLINICAL_TESTS.get(slug)
    if test is None:
        raise Http404
    (course,) = [each for each in load_courses(user, patient) if each.test is test]
    last = course.last
    form = AssessmentForm(
        request.POST or None, test=test, initial={"device": last.device if last else ""}
    )
    if request.method == "POST" and form.is_valid():
        row = Assessment.everywhere.create(
            clinic_id=patient.clinic_id,
            patient=patient,
            test=slug,
            value=form.cleaned_data["value"],
            device=form.cleaned_data["device"],
            at=timezone.now(),
            by=user,
        )
        messages.success(
            request,
            gettext("%(test)s of %(name)s: %(result)s")
            % {
                "test": gettext(test.label),
                "name": patient.nickname,
                "result": format_result(test, row.value),
            },
        )
        return redirect("assessments", patient_id=patient.pk)
    context = {
        "patient": patient,
        "test": test,
        "course": course,
        "form": form,
        "has_timer": test.way is not Way.SCORE,
        "lap_test_s": LAP_TEST_S if test.way is Way.LAPS else 0,
    }
    return render(request, "sessions/assess.html", context)


@for_roles(Role.LEAD, Role.PT)
@require_POST
def strike_out(request: HttpRequest, patient_id: int) -> HttpResponse:
    """Strike a wrong result out; it stays stored."""
    user = user_of(request)
    patient = get_patient(user, patient_id)
    rows = Assessment.objects.visible_to(user).filter(patient=patient, struck_at=None)
    rows.filter(pk=read_key(request.POST.get("result", "")) or 0).update(struck_at=timezone.now())
    return redirect("assessments", patient_id=patient.pk)
