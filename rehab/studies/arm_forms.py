"""The forms of a study's arms."""

from __future__ import annotations

from typing import Any

from django import forms
from django.utils.translation import gettext_lazy as _

from rehab.people.models import User
from rehab.people.ranges import NumberField, say_ranges
from rehab.sessions.forms.initial import WITH_BASELINE
from rehab.sessions.setup.options import OPTIONS
from rehab.sessions.setup.protocol_models import MeasureDefinition, Protocol
from rehab.studies.models import SCHEDULE_FIELDS, Arm, Study
from rehab.training.measures import A2

ARMS_OFFERED = 4  # rows on the page of a new study
CODES = dict(zip("0123", "ABCD", strict=True))  # of a new arm, by its row


class ArmForm(forms.ModelForm):
    """One arm of a study. Empty rows are left out."""

    FRONT = ("code", "name", "valence", "protocol")

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
            walks = fields["protocol"].queryset.filter(clinic=None, name=WITH_BASELINE).first()
            self.initial["protocol"] = walks and walks.pk
            row = str(self.prefix).rpartition("-")[2]
            self.initial["code"] = CODES.get(row, "")
        for name in ("code", "weight"):
            fields[name].disabled = is_fixed
        for name in SCHEDULE_FIELDS:
            fields[name].required = False

    def has_changed(self) -> bool:
        """Return whether something was filled in: what is offered, or emptied, does not count."""
        return any(self[name].data for name in self.changed_data)

    @property
    def front(self) -> list[Any]:
        """The fields that each arm needs."""
        return [self[name] for name in self.FRONT]

    @property
    def more(self) -> list[Any]:
        """All others."""
        return [one for one in self.visible_fields() if one.name not in self.FRONT]

    @property
    def is_more_open(self) -> bool:
        """Whether one of the others is not as usual."""
        return any(one.errors or one.name in self.unusual for one in self.more)

    @property
    def unusual(self) -> set[str]:
        """The fields that a new arm would not have so."""
        names = ("gain", *SCHEDULE_FIELDS, "robot_intensity", "weight")
        usual = Arm()
        return {name for name in names if getattr(self.instance, name) != getattr(usual, name)}

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
