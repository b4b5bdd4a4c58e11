"""Results of standard tests and of a clinic's own (`available_tests`), and their course."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Sequence
from dataclasses import dataclass
from datetime import timedelta
from typing import ClassVar

from django.db import models
from django.utils import timezone
from django.utils.functional import cached_property
from django.utils.translation import gettext
from django.utils.translation import gettext_lazy as _

from rehab.people.consent.models import PatientScope
from rehab.people.field_policy import erased, personal_fields, retained
from rehab.people.models import Clinic, Patient, User
from rehab.people.scope import ClinicModel
from rehab.questionnaires.standard_tests import CLINICAL_TESTS, PURPOSES, ClinicalTest
from rehab.sessions.available_tests import find_test, own_tests
from rehab.sessions.formatting import MISSING, clinic_time, format_number
from rehab.sessions.models import TrainingSession
from rehab.sessions.setup.walking_conditions import MAX_DEVICE_LETTERS
from rehab.sessions.spark import draw_spark


class Assessment(ClinicModel):
    """A result of a test. A wrong one is struck out, and stays stored.

    Of a clinic's own form ``answers`` has what it is the sum of, as pairs of item and number;
    ``remarks`` what was written, also why an unusual number is right.
    """

    scope = PatientScope(clinic="clinic", tells_condition=False)

    clinic = models.ForeignKey(
        Clinic, on_delete=models.PROTECT, related_name="assessments", verbose_name=_("clinic")
    )
    patient = models.ForeignKey(
        Patient, on_delete=models.PROTECT, related_name="assessments", verbose_name=_("patient")
    )
    test = models.CharField(_("test"), max_length=16)
    value = models.FloatField(_("result"))
    answers = models.JSONField(_("answers"), default=list, blank=True)
    remarks = models.TextField(_("remarks"), blank=True)
    device = models.CharField(_("walked with"), max_length=MAX_DEVICE_LETTERS, blank=True)
    at = models.DateTimeField(_("when"), default=timezone.now)
    by = models.ForeignKey(
        User, on_delete=models.SET_NULL, related_name="+", null=True, verbose_name=_("by")
    )
    struck_at = models.DateTimeField(_("struck out"), null=True, editable=False)

    personal = personal_fields(
        {
            "clinic patient test value answers device at struck_at": retained(
                "a measurement under a pseudonym", shown=True, research=True
            ),
            "remarks": erased("", shown=True, research=False),
            "by": retained("staff", shown=True, research=False),
        }
    )

    class Meta(ClinicModel.Meta):
        verbose_name = _("test result")
        verbose_name_plural = _("test results")
        ordering: ClassVar = ["at", "pk"]
        indexes: ClassVar = [
            models.Index(fields=["patient", "test", "at"], name="assessment_by_patient")
        ]

    def __str__(self) -> str:
        return f"{gettext(self.definition.label)}: {format_result(self.definition, self.value)}"

    @cached_property
    def definition(self) -> ClinicalTest:
        """What it is a result of."""
        test = find_test(self.test, self.clinic_id)
        assert test is not None  # noqa: S101 - a test with results is not deleted
        return test


@dataclass(frozen=True, slots=True)
class Course:
    """A test of one patient with its results, oldest first; without those struck out."""

    test: ClinicalTest
    results: Sequence[Assessment]
    norm: tuple[float, float] | None

    @property
    def purpose(self) -> str:
        """What the test measures, and how long it takes; empty for a clinic's own."""
        if self.test.slug not in PURPOSES:
            return ""
        what, minutes = PURPOSES[self.test.slug]
        return gettext("%(what)s; about %(count)s min") % {"what": gettext(what), "count": minutes}

    @property
    def last(self) -> Assessment | None:
        """The newest result."""
        return self.results[-1] if self.results else None

    @property
    def verdict(self) -> int:
        """Whether the newest result differs from the first: 1 better, -1 worse, 0 no change."""
        if len(self.results) < 2:
            return 0
        return self.test.judge(self.results[0].value, self.results[-1].value)

    @property
    def now(self) -> str:
        """The newest result with its unit."""
        return MISSING if self.last is None else format_result(self.test, self.last.value)

    @property
    def first(self) -> str:
        """The first result with its unit; empty if the newest is the only one."""
        return format_result(self.test, self.results[0].value) if len(self.results) > 1 else ""

    @property
    def summary(self) -> str:
        """The newest result, and the first one if there was one before."""
        if not self.first:
            return self.now
        return gettext("%(now)s, at first %(first)s") % {"now": self.now, "first": self.first}

    @property
    def usual(self) -> str:
        """The usual range at the patient's age as text; empty where none is known."""
        if self.norm is None:
            return ""
        low, high = (format_number(end, self.test.places) for end in self.norm)
        text = f"{low if low == high else f'{low}–{high}'} {self.test.unit}".rstrip()
        if self.norm[0] == self.test.least:
            return gettext("up to %(most)s") % {"most": f"{high} {self.test.unit}"}
        return text

    @property
    def ends(self) -> tuple[str, str]:
        """Its best and worst result, as text: what is at the top of its line and at the foot."""
        values = sorted((one.value for one in self.results), reverse=self.test.higher_is_better)
        return format_result(self.test, values[0]), format_result(self.test, values[-1])

    @property
    def spark(self) -> list[str]:
        """The points of its line, better results higher."""
        values = [one.value for one in self.results]
        return draw_spark(values, higher_is_better=self.test.higher_is_better)


def format_result(test: ClinicalTest, value: float) -> str:
    """Return a result as text with its unit; of a score the most that it can be."""
    number = format_number(value, test.places)
    return f"{number} {test.unit}" if test.unit else f"{number} / {format_number(test.most, 0)}"


def load_courses(user: User, patient: Patient) -> list[Course]:
    """Return every test that is offered or has results of a patient, the clinic's own ones last."""
    found: defaultdict[str, list[Assessment]] = defaultdict(list)
    rows = Assessment.objects.visible_to(user).filter(patient=patient, struck_at=None)
    for row in rows.order_by("at", "pk"):
        found[row.test].append(row)
    age = patient.birth_year and clinic_time(timezone.now(), patient.clinic).year - (
        patient.birth_year
    )
    tests = CLINICAL_TESTS | own_tests(patient.clinic_id, is_offered=True)
    tests |= {slug: rows[0].definition for slug, rows in found.items() if slug not in tests}
    return [Course(test, found[slug], test.find_norm(age)) for slug, test in tests.items()]


def assessments_with(user: User, session: TrainingSession) -> models.QuerySet[Assessment]:
    """Return the results that go with a session: from its day on, until the next session's day.

    So each result of a patient goes with one session; those before the first one go with it.
    """
    sessions = TrainingSession.objects.visible_to(user).filter(patient=session.patient_id)
    others = sessions.exclude(pk=session.pk)
    rows = Assessment.objects.visible_to(user).filter(patient=session.patient_id, struck_at=None)
    if others.filter(created_at__lte=session.created_at).exists():
        rows = rows.filter(at__gte=_day_of(session))
    later = others.filter(created_at__gt=session.created_at).order_by("created_at").first()
    if later is not None:
        rows = rows.filter(at__lt=_day_of(later))
    return rows.order_by("at", "pk")


def _day_of(session: TrainingSession) -> object:
    """Return the midnight before a session, by the clinic's clock."""
    began = clinic_time(session.created_at, session.clinic)
    return began - timedelta(
        hours=began.hour, minutes=began.minute, seconds=began.second, microseconds=began.microsecond
    )
