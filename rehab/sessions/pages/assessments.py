"""Tests of a patient: the list with each course, and a page for each test."""

from __future__ import annotations

from collections.abc import Sequence
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
from rehab.people.ranges import NumberField, WholeNumberField, range_message
from rehab.people.roles import Role
from rehab.people.row_values import read_key
from rehab.people.web.refusals import format_refusal
from rehab.questionnaires.form_items import MAX_LETTERS, FormItem, total
from rehab.questionnaires.standard_tests import (
    LAP_TEST_S,
    STOP_AT_ONCE,
    ClinicalTest,
    Way,
    to_speed,
)
from rehab.sessions.assessment_results import Assessment, format_result, load_courses
from rehab.sessions.available_tests import fix_tests
from rehab.sessions.formatting import format_number
from rehab.sessions.setup.walking_conditions import MAX_DEVICE_LETTERS
from rehab.training.measures import InvalidSetting

USUAL_METERS = 10.0
SCORED = (Way.SCORE, Way.FORM)
STORED = ("value", "answers", "remarks", "device")  # of a form, in the row


class AssessmentForm(forms.Form):
    """The result of a test, as it is measured; a speed follows from distance and time."""

    def __init__(self, *args: Any, test: ClinicalTest, **options: Any) -> None:
        super().__init__(*args, **options)
        self.label_suffix = ""
        self.test = test
        self.fields.update(_fields_of(test))
        if not self.is_bound:
            self.fields.pop("why", None)  # it is asked once a number is unusual
        self.fields["device"] = forms.CharField(
            label=_("Walking aid, orthosis, help (if any)"),
            required=False,
            max_length=MAX_DEVICE_LETTERS,
            widget=forms.TextInput(attrs={"form": "result"}),  # over the timer, before Go
        )

    def clean(self) -> dict[str, Any]:
        """Return the data with the ``value`` of the result. Refuses what the test cannot have."""
        data: dict[str, Any] = super().clean() or {}
        if self.test.items:
            return data if self.errors else data | self._sum_up(data)
        measured, meters = data.get("measured"), data.get("meters")
        if measured is None or (self.test.way is Way.SPEED and meters is None):
            return data
        try:
            value = to_speed(meters, measured) if meters is not None else float(measured)
            self.test.check(value)
        except InvalidSetting as problem:
            raise ValidationError(format_refusal(problem)) from problem
        return data | {"value": value}

    def _sum_up(self, data: dict[str, Any]) -> dict[str, Any]:
        """Return value, answers and remarks of a form. Asks unusual numbers back."""
        given = [(item, data[f"item_{n}"]) for n, item in enumerate(self.test.items)]
        why = data.get("why", "")
        if not why:
            for number, (item, answer) in enumerate(given):
                if item.is_unusual(answer):
                    self.add_error(f"item_{number}", _ask_back(item))
        remarks = [f"{item.text}: {words}" for item, words in given if item.is_text and words]
        counted = [(item.text, float(answer)) for item, answer in given if not item.is_text]
        return {
            "value": total(self.test.items, [answer for _text, answer in counted]),
            "answers": counted,
            "remarks": "\n".join((*remarks, *filter(None, [why]))),
        }


def _fields_of(test: ClinicalTest) -> dict[str, forms.Field]:
    """Return the fields of what a test measures."""
    if test.items:
        fields = {f"item_{n}": _field_of(item) for n, item in enumerate(test.items)}
        if any(item.usual for item in test.items):
            label = _("If a number is unusual: why it is right")
            fields["why"] = forms.CharField(label=label, required=False, max_length=MAX_LETTERS)
        return fields
    if test.way is Way.SPEED:
        meters = NumberField(label=_("Timed distance, m"), least=1, most=100, unit="m")
        meters.initial = f"{USUAL_METERS:g}"
        return {
            "meters": meters,
            "measured": NumberField(label=_("Time, s"), least=0.5, most=600, unit="s"),
        }
    if test.levels:
        return {"measured": _choose(_("Category"), [_(words) for words in test.levels])}
    labels = {Way.LAPS: _("Distance, m"), Way.STOPWATCH: _("Time, s"), Way.SCORE: _("Total")}
    label = labels[test.way]
    return {"measured": NumberField(label=label, least=test.least, most=test.most, unit=test.unit)}


def _field_of(item: FormItem) -> forms.Field:
    if item.is_text:
        return forms.CharField(label=item.text, required=False, max_length=MAX_LETTERS)
    if item.words:
        return _choose(item.text, item.words)
    kind = NumberField if item.places else WholeNumberField
    words = range_message(item.least, item.most)
    return kind(label=item.text, least=item.least, most=item.most, help_text=words)


def _choose(label: Any, words: Sequence[Any]) -> forms.ChoiceField:
    """Return a choice that counts from 0."""
    levels = [(str(level), f"{level} · {word}") for level, word in enumerate(words)]
    return forms.ChoiceField(label=label, choices=levels, widget=forms.RadioSelect)


def _ask_back(item: FormItem) -> str:
    low, high = item.usual or (0.0, 0.0)
    return gettext(
        "Outside the usual %(low)s to %(high)s. Check it; if it is right, say why below."
    ) % {"low": format_number(low, item.places), "high": format_number(high, item.places)}


@for_roles(Role.LEAD, Role.PT)
@require_safe
def list_assessments(request: HttpRequest, patient_id: int) -> HttpResponse:
    """Show every standard test with a patient's results and their course."""
    user = user_of(request)
    patient = get_patient(user, patient_id)
    courses = load_courses(user, patient)
    context = {"patient": patient, "courses": courses, "scored": SCORED}
    return render(request, "sessions/assessments.html", context)


@for_roles(Role.LEAD, Role.PT)
@require_http_methods(["GET", "HEAD", "POST"])
def assess(request: HttpRequest, patient_id: int, slug: str) -> HttpResponse:
    """Take a test: what to do, the stopwatch, and the result."""
    user = user_of(request)
    patient = get_patient(user, patient_id)
    course = next((each for each in load_courses(user, patient) if each.test.slug == slug), None)
    if course is None:
        raise Http404
    test = course.test
    last = course.last
    form = AssessmentForm(
        request.POST or None, test=test, initial={"device": last.device if last else ""}
    )
    if request.method == "POST" and form.is_valid():
        fix_tests(patient.clinic_id, [slug])
        row = Assessment.everywhere.create(
            clinic_id=patient.clinic_id,
            patient=patient,
            test=slug,
            **{name: form.cleaned_data[name] for name in STORED if name in form.cleaned_data},
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
        "asked": [field for field in form if field.name != "device" or test.way in SCORED],
        "warning": STOP_AT_ONCE if STOP_AT_ONCE in test.steps else "",
        "steps": [step for step in test.steps if step != STOP_AT_ONCE],
        "has_timer": test.way not in SCORED,
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
