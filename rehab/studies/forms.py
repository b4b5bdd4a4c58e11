"""The forms with which a study is planned."""

from __future__ import annotations

import contextlib
import secrets
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

from django import forms
from django.core.exceptions import ValidationError
from django.db import transaction
from django.utils.functional import Promise
from django.utils.translation import gettext_lazy as _

from rehab.people.web.refusals import format_refusal
from rehab.people.web.row_forms import ClinicForm
from rehab.studies.allocation.blocks import MAX_BLOCK
from rehab.studies.allocation.lists import read_list
from rehab.studies.allocation.scheme import Method, Secret
from rehab.studies.analysis.outcomes import OF_QUESTIONS
from rehab.studies.arm_forms import save_arms
from rehab.studies.arms import EARLY_MONTHS
from rehab.studies.models import Study
from rehab.studies.registration.allocation_secret import seal, unseal
from rehab.studies.registration.lifecycle import check_secret
from rehab.studies.registration.measurable import (
    SEVERAL_VISITS,
    needs_follow_up,
)
from rehab.studies.registration.problems import DECIDES, Problem, UnfitPlan, find_problems
from rehab.studies.registration.size import read_assumed
from rehab.studies.size_form import STORED, AssumedForm
from rehab.training.measures import InvalidSetting

SEED_BYTES = 16  # of a study's seed: too many to try them all
LIST_LETTERS_MAX = 500_000
# What allocates is fixed by the registration.
ALLOCATION_FIELDS = (
    "code",
    "crossover",
    "method",
    "block_sizes",
    "factors_text",
    "allocation_list",
)


@dataclass(frozen=True, slots=True)
class Section:
    """A part of the page: what is asked in it; folded where its usual answers do for most."""

    title: str | Promise
    names: tuple[str, ...]
    usual: str | Promise = ""  # of a folded one: what holds unless it is opened

    @property
    def is_sized(self) -> bool:
        """Whether it says how many participants are needed."""
        return "participants" in self.names


SECTIONS = (
    Section(_("Question"), ("reason", "needs_consent", "code", "title", "question")),
    Section(_("Outcome"), ("primary_outcome", "visits", "follow_up_days")),
    Section(
        _("How many take part"),
        ("difference", "planned_sd", "correlation", "power_percent", "dropout_percent",
         "participants"),
    ),
    Section(_("Who may take part"), ("months_since_stroke", "inclusion", "exclusion")),
    Section(_("Secondary outcomes"), ("secondary_outcomes",), _("all others are exploratory")),
    Section(
        _("Days and goal"),
        ("days_between", "window_days", "washout_days", "goal_percent"),
        _("visits a day apart, goal as high as the baseline"),
    ),
    Section(
        _("Allocation"),
        ("method", "block_sizes", "factors_text", "allocation_list"),
        _("blocks of random size, no strata"),
    ),
    Section(
        _("Non-inferiority, and looks before the end"),
        ("margin", "spending"),
        _("which arm is better; no look"),
    ),
)  # fmt: skip


class StudyForm(ClinicForm, AssumedForm):
    """The plan of a study. Of a registered one, the allocation is fixed; changes need a reason."""

    block_sizes = forms.CharField(
        label=_("sizes of blocks"),
        required=False,
        help_text=_(
            "Of permuted blocks, drawn at random. Sealed: those who enroll patients do not see "
            "them. Empty: two and three times the ratio, such as 4 and 6."
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
    primary_outcome = forms.ChoiceField(label=_("primary outcome"))
    secondary_outcomes = forms.MultipleChoiceField(
        label=_("secondary outcomes"),
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
            *("inclusion", "exclusion", "crossover", "visits", "days_between", "window_days"),
            *("washout_days", "follow_up_days", "goal_percent"),
            *("primary_outcome", "secondary_outcomes", "margin", "spending", "planned_sd"),
            "method",
        )
        widgets = {
            "question": forms.Textarea(attrs={"rows": 2}),
            "inclusion": forms.Textarea(attrs={"rows": 2}),
            "exclusion": forms.Textarea(attrs={"rows": 2}),
        }

    def __init__(self, *args: Any, **options: Any) -> None:
        super().__init__(*args, **options)
        study: Study = self.instance
        fields: dict[str, Any] = self.fields
        choices = outcome_choices(study)
        fields["primary_outcome"].choices = [("", _("Choose")), *choices]
        fields["secondary_outcomes"].choices = choices
        for key, (name, of) in STORED.items():
            if key in study.assumed:
                self.initial[name] = f"{of * study.assumed[key]:.10g}"
            elif not study.is_draft:  # what was not registered is not added unasked
                self.initial[name] = None
        if not self.instance.pk:
            self.initial["months_since_stroke"] = EARLY_MONTHS
        if study.is_draft:
            del self.fields["reason"], self.fields["needs_consent"]
            lines = (f"{name}: {', '.join(levels)}" for name, levels in study.factors)
            self.initial["factors_text"] = "\n".join(lines)
            if study.sealed:
                sizes = unseal(study.sealed).block_sizes
                shown = () if sizes == usual_sizes(study) else sizes
                self.initial["block_sizes"] = ", ".join(map(str, shown))
        else:
            for name in ALLOCATION_FIELDS:
                del self.fields[name]

    @property
    def is_crossover(self) -> bool:
        """Whether it is one: what is registered cannot be changed."""
        is_fixed = "crossover" not in self.fields
        return self.instance.crossover if is_fixed else super().is_crossover

    def sections(self) -> Iterator[dict[str, Any]]:
        """Yield the parts of the page, each with its fields, and whether it stands open."""
        for section in SECTIONS:
            own = [self[name] for name in section.names if name in self.fields]
            told = [one for one in own if one.errors or not _is_usual(one)]
            yield {"about": section, "fields": own, "is_open": bool(told)}

    def clean(self) -> Any:
        """Return the answers. Refuses assumptions from which no size follows."""
        data: Any = super().clean()
        try:
            read_assumed(self.plan)
        except InvalidSetting as problem:
            raise ValidationError(format_refusal(problem)) from problem
        self.instance.assumed = self.assumed
        return data

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
        sizes = data["block_sizes"] or usual_sizes(study)
        secret = Secret(before.seed, sizes if is_blocks else (), listed if is_list else ())
        study.sealed = seal(secret)
        check_secret(study)


def usual_sizes(study: Study) -> tuple[int, ...]:
    """Return the sizes of blocks unless others are given: whole, and not to be guessed by two."""
    share = sum(group.weight for group in study.groups())
    return tuple(size for size in (2 * share, 3 * share) if size <= MAX_BLOCK) or (share,)


OF_VISIT, SEVERAL = _("Of each visit’s strides"), _("From visit to visit")
TESTS = _("Tests by an assessor, after training")
QUESTIONS = _("Questionnaires, after each visit")
AT_FOLLOW_UP = _("At the follow-up, once its day is planned")


def outcome_choices(study: Study) -> list[tuple[Promise, list[tuple[str, Any]]]]:
    """Return the outcomes in groups, by what they need."""
    found: dict[Promise, list[tuple[str, Any]]] = {
        group: [] for group in (OF_VISIT, SEVERAL, QUESTIONS, TESTS, AT_FOLLOW_UP)
    }
    for slug, outcome in study.outcomes.items():
        group = TESTS if outcome.window else SEVERAL if slug in SEVERAL_VISITS else OF_VISIT
        group = QUESTIONS if slug in OF_QUESTIONS else group
        group = AT_FOLLOW_UP if needs_follow_up(outcome) else group
        found[group].append((slug, study.outcome_label(slug)))
    return list(found.items())


def _is_usual(field: Any) -> bool:
    """Return whether a field holds what a new study has."""
    value = field.value()
    usual = getattr(Study(), field.name, field.field.initial)
    if isinstance(usual, int | float):
        with contextlib.suppress(TypeError, ValueError):
            return float(value) == usual
    return not value or str(value) == str(usual)


def save_draft(form: StudyForm, arms: Any) -> Study:
    """Store a draft from its valid ``form`` and the valid formset ``arms``, and return it.

    Raises UnfitPlan, and stores nothing, for a study that could not be run.
    """
    with transaction.atomic():
        study: Study = form.save()
        save_arms(arms, study)
        problems = []
        try:
            form.seal_allocation()
        except InvalidSetting as problem:
            field = DECIDES.get(Method(study.method), "factors_text")
            problems.append(Problem(format_refusal(problem), field))
        study.save()
        found = find_problems(study)
        told = {one.words for one in found}
        if problems := [*found, *(one for one in problems if one.words not in told)]:
            raise UnfitPlan(problems)
    return study
