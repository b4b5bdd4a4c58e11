"""Tests that a clinic's patients can take: the standard ones, and the clinic's own forms."""

from __future__ import annotations

from typing import Any, ClassVar

from django.core.exceptions import ValidationError
from django.core.validators import RegexValidator
from django.db import models
from django.utils import timezone
from django.utils.translation import gettext_lazy as _

from rehab.people.models import Clinic
from rehab.people.ranges import between
from rehab.people.scope import ClinicModel, Scope
from rehab.people.web.refusals import format_refusal
from rehab.questionnaires.form_items import read_form_items
from rehab.questionnaires.standard_tests import CLINICAL_TESTS, ClinicalTest, Way
from rehab.training.measures import InvalidSetting

OWN = "own-"  # begins the slug of a clinic's own test


class ClinicTest(ClinicModel):
    """A clinic's own assessment form, whose result is the sum of its items.

    Once a result is stored, or a study that uses it registered, its definition stays as it is.
    """

    scope = Scope(clinic="clinic")

    clinic = models.ForeignKey(
        Clinic, on_delete=models.CASCADE, related_name="own_tests", verbose_name=_("clinic")
    )
    code = models.CharField(
        _("short name"),
        max_length=12,
        validators=[RegexValidator(r"^[a-z][a-z0-9]{1,11}\Z", _("2 to 12 small letters, digits."))],
        help_text=_("Names it in exports. Clinics of one study give it the same."),
    )
    name = models.CharField(_("name"), max_length=64)
    steps = models.TextField(
        _("how it is done"), max_length=2000, blank=True, help_text=_("A line for each step.")
    )
    items = models.TextField(
        _("items"),
        max_length=12_000,
        help_text=_(
            "A line each. A number in a range: “Knee bends | 0 | 2”. One that is asked back "
            "outside of what is usual: “Knee angle | 0 | 150 | 20 | 120”. A choice, which counts "
            "0, 1, 2: “Tone | none, some, much”. A remark: “Shoes | text”. The result is the sum."
        ),
    )
    unit = models.CharField(
        _("unit"), max_length=16, blank=True, help_text=_("Of the result. Empty: points.")
    )
    higher_is_better = models.BooleanField(_("a higher result is better"), default=True)
    least_change = models.FloatField(
        _("least change that counts"),
        null=True,
        blank=True,
        validators=between(0),
        help_text=_("Smaller changes are shown as no change. Empty: each one counts."),
    )
    is_offered = models.BooleanField(
        _("offered"), default=True, help_text=_("Off: results stay, and no new ones are taken.")
    )
    fixed_at = models.DateTimeField(_("fixed since"), null=True, editable=False)

    class Meta(ClinicModel.Meta):
        verbose_name = _("test of the clinic’s own")
        verbose_name_plural = _("tests of the clinic’s own")
        ordering: ClassVar = ["name"]
        constraints: ClassVar = [
            models.UniqueConstraint(fields=["clinic", "code"], name="own_test_once_per_clinic")
        ]

    def __str__(self) -> str:
        return self.name

    @property
    def slug(self) -> str:
        """What results and studies call it."""
        return f"{OWN}{self.code}"

    def to_test(self) -> ClinicalTest:
        """Return it in the form that the rules use. Raises InvalidSetting."""
        items = read_form_items(self.items)
        counted = [item for item in items if not item.is_text]
        return ClinicalTest(
            slug=self.slug,
            label=self.name,
            unit=self.unit,
            places=max(item.places for item in counted),
            least=sum(item.least for item in counted),
            most=sum(item.most for item in counted),
            higher_is_better=self.higher_is_better,
            way=Way.FORM,
            steps=tuple(filter(None, map(str.strip, self.steps.splitlines()))),
            least_change=self.least_change,
            items=items,
        )

    def clean(self) -> None:
        """Refuse what the rules refuse, and a change of what results are compared by."""
        try:
            test = self.to_test()
        except InvalidSetting as problem:
            raise ValidationError({"items": format_refusal(problem)}) from problem
        before = ClinicTest.everywhere.filter(pk=self.pk, fixed_at__isnull=False).first()
        if before and before.to_test() != test:
            raise ValidationError(
                _(
                    "Results or a registered study use this form as it is. Make a new one with "
                    "another short name, and switch off “offered” here."
                )
            )


def own_tests(clinic_id: int, **chosen: Any) -> dict[str, ClinicalTest]:
    """Return a clinic's own tests by slug. ``chosen``: further conditions on the rows."""
    rows = ClinicTest.everywhere.filter(clinic=clinic_id, **chosen)
    return {row.slug: row.to_test() for row in rows}


def find_test(slug: str, clinic_id: int) -> ClinicalTest | None:
    """Return a test by its slug; None where there is none."""
    known = CLINICAL_TESTS.get(slug)
    if known is not None or not slug.startswith(OWN):
        return known
    return own_tests(clinic_id, code=slug.removeprefix(OWN)).get(slug)


def fix_tests(clinic_id: int, slugs: list[str]) -> None:
    """Fix the definitions of a clinic's own tests, by their slugs; others are as they are."""
    codes = [slug.removeprefix(OWN) for slug in slugs if slug.startswith(OWN)]
    rows = ClinicTest.everywhere.filter(clinic=clinic_id, code__in=codes, fixed_at=None)
    rows.update(fixed_at=timezone.now())
