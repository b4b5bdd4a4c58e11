"""The forms with which a study is planned."""

from __future__ import annotations

import secrets
from typing import Any

from django import forms
from django.core.exceptions import ValidationError
from django.db import transaction
from django.utils.translation import gettext_lazy as _

from rehab.people.models import User
from rehab.people.ranges import NumberField, say_ranges
from rehab.people.web.row_forms import ClinicForm
from rehab.sessions.setup.options import OPTIONS
from rehab.sessions.setup.protocols import MeasureDefinition, Protocol
from rehab.studies.allocation.lists import read_list
from rehab.studies.allocation.scheme import Method, Secret
from rehab.studies.models import OUTCOMES, SCHEDULE_FIELDS, Arm, Study
from rehab.studies.registration.document import describe
from rehab.studies.registration.lifecycle import check_secret
from rehab.studies.registration.sealing import seal, unseal
from rehab.training.measures import A2

SEED_BYTES = 16  # of a study's seed: too many to try them all
LIST_LETTERS_MAX = 500_000
ARMS_OFFERED = 4  # rows on the page of a new study
# What allocates is fixed by the registration.
ALLOCATION_FIELDS = (
    "code",
    "crossover",
    "method",
    "block_sizes",
    "factors_text",
    "allocation_list",
)


class StudyForm(ClinicForm):
    """The plan of a study. Of a registered one, the allocation is fixed; changes need a reason."""

    block_sizes = forms.CharField(
        label=_("sizes of blocks"),
        initial="4, 6",
        required=False,
        help_text=_(
            "Of permuted blocks, drawn at random. Sealed: those who enroll patients do not see "
            "them."
        ),
    )
    factors_text = forms.CharField(
        label=_("factors to balance"),
        required=False,
        widget=forms.Textarea(attrs={"rows": 3, "placeholder": _("Severity: mild, severe")}),
        help_text=_("One a line, with its levels: “Severity: mild, severe”. Empty: none."),
    )
    allocation_list = forms.CharField(
        label=_("list of allocations"),
        max_length=LIST_LETTERS_MAX,
        required=False,
        widget=forms.Textarea(attrs={"rows": 4}),
        help_text=_(
            "Only for a list of your own: paste its CSV, with the columns number, each factor, and "
            "group. It is sealed, and not shown again."
        ),
    )
    secondary_outcomes = forms.MultipleChoiceField(
        label=_("secondary outcomes"),
        choices=OUTCOMES,
        required=False,
        widget=forms.CheckboxSelectMultiple,
    )
    reason = forms.CharField(
        label=_("why it is changed"), max_length=1000, widget=forms.Textarea(attrs={"rows": 2})
    )
    needs_consent = forms.BooleanField(
        label=_("participants have to agree to it before their next visit"), required=False
    )

    class Meta:
        model = Study
        fields = (
            *("code", "title", "question", "participants", "months_since_stroke"),
            *("inclusion", "exclusion", "crossover"),
            *("visits", "days_between", "washout_days", "follow_up_days", "goal_percent"),
            *("primary_outcome", "secondary_outcomes", "margin", "spending", "planned_sd"),
            "method",
        )
        widgets = {
            "question": forms.Textarea(attrs={"rows": 4}),
            "inclusion": forms.Textarea(attrs={"rows": 3}),
            "exclusion": forms.Textarea(attrs={"rows": 3}),
        }

    def __init__(self, *args: Any, **options: Any) -> None:
        super().__init__(*args, **options)
        study: Study = self.instance
        if study.is_draft:
            del self.fields["reason"], self.fields["needs_consent"]
            lines = (f"{name}: {', '.join(levels)}" for name, levels in study.factors)
            self.initial["factors_text"] = "\n".join(lines)
            if study.sealed:
                sizes = unseal(study.sealed).block_sizes
                self.initial["block_sizes"] = ", ".join(map(str, sizes))
        else:
            for name in ALLOCATION_FIELDS:
                del self.fields[name]

    def clean_block_sizes(self) -> tuple[int, ...]:
        """Return the sizes, as whole numbers."""
        words = self.cleaned_data["block_sizes"].replace(";", ",").split(",")
        try:
            return tuple(int(word) for word in words if word.strip())
        except ValueError:
            raise ValidationError(_("Give whole numbers with commas, such as “4, 6”.")) from None

    def clean_factors_text(self) -> list[list[Any]]:
        """Return the factors with their levels."""
        factors = []
        for line in filter(str.strip, self.cleaned_data["factors_text"].splitlines()):
            name, colon, levels = line.partition(":")
            if not colon:
                message = _("“%(line)s” has no levels. Write it as “Severity: mild, severe”.")
                raise ValidationError(message, params={"line": line})
            factors.append([name.strip(), [level.strip() for level in levels.split(",")]])
        return factors

    def seal_allocation(self) -> None:
        """Set the study's factors and sealed secret from the form; the arms are stored already.

        Raises InvalidSetting for what does not fit the arms.
        """
        study, data = self.instance, self.cleaned_data
        study.factors = data["factors_text"]
        before = unseal(study.sealed) if study.sealed else Secret(secrets.token_hex(SEED_BYTES))
        listed = before.listed
        if data["allocation_list"]:
            scheme = study.scheme()
            listed = read_list(data["allocation_list"], scheme.groups, scheme.factors)
        is_list, is_blocks = study.method == Method.LIST, study.method == Method.BLOCKS
        secret = Secret(
            before.seed, data["block_sizes"] if is_blocks else (), listed if is_list else ()
        )
        study.sealed = seal(secret)
        check_secret(study)


class ArmForm(forms.ModelForm):
    """One arm of a study. Empty rows are left out."""

    gain = NumberField(label=_("gain"), initial=1.0)

    class Meta:
        model = Arm
        fields = (
            *("code", "name", "valence", "gain", *SCHEDULE_FIELDS, "robot_intensity"),
            *("measure", "protocol", "weight"),
        )

    def __init__(self, *args: Any, by: User, is_fixed: bool, **options: Any) -> None:
        super().__init__(*args, **options)
        say_ranges(self)
        fields: dict[str, Any] = self.fields
        fields["measure"].queryset = MeasureDefinition.objects.visible_to(by)
        fields["protocol"].queryset = Protocol.objects.visible_to(by)
        if self.instance.pk is None:
            usual = fields["measure"].queryset.filter(clinic=None, slug=A2.slug).first()
            self.initial["measure"] = usual and usual.pk
        for name in ("code", "weight"):
            fields[name].disabled = is_fixed
        for name in SCHEDULE_FIELDS:
            fields[name].required = False

    def clean(self) -> Any:
        """Return the answers, with defaults for fields of the schedule that were left empty."""
        data: Any = super().clean()
        empty = [name for name in SCHEDULE_FIELDS if data.get(name) in (None, "")]
        return data | {name: OPTIONS[name].default for name in empty if name not in self.errors}


def build_arm_forms(study: Study, by: User, data: Any = None) -> Any:
    """Return the formset of a study's arms; that of a draft has empty rows to fill in.

    It offers the protocols and measures of the account ``by``; ``data``: what was sent, or None.
    """
    is_fixed = not study.is_draft
    stored = study.arms.count() if study.pk else 0
    factory: Any = forms.inlineformset_factory(
        Study,
        Arm,
        form=ArmForm,
        extra=0 if is_fixed else max(ARMS_OFFERED - stored, 1),
        can_delete=not is_fixed,
    )
    return factory(data, instance=study, form_kwargs={"by": by, "is_fixed": is_fixed}, prefix="arm")


def save_arms(arms: Any, study: Study) -> None:
    """Store the arms of a valid formset ``arms`` in a study, in the order of the rows."""
    arms.instance = study
    arms.save(commit=False)
    for row in arms.deleted_objects:
        row.delete()
    filled = [f for f in arms.forms if f.instance.code and f not in arms.deleted_forms]
    for position, form in enumerate(filled):
        form.instance.study, form.instance.position = study, position
        form.instance.save()


def save_draft(form: StudyForm, arms: Any) -> Study:
    """Store a draft from its valid ``form`` and the valid formset ``arms``, and return it.

    Raises InvalidSetting, and stores nothing, for a study that could not be run.
    """
    with transaction.atomic():
        study: Study = form.save()
        save_arms(arms, study)
        form.seal_allocation()
        study.save()
        describe(study)
    return study
