"""The forms of a study's record: what it is asked, and how an adverse event is judged."""

from __future__ import annotations

from typing import Any

from django import forms
from django.core.exceptions import ValidationError
from django.utils.translation import gettext_lazy as _

from rehab.people.models import User
from rehab.sessions.forms.names import refuse_names
from rehab.studies.models import Study
from rehab.studies.participants import Enrollment
from rehab.studies.record.adverse_events import AdverseEvent
from rehab.studies.registration.facts import ASKED

LETTERS_MAX = 4000


class FactsForm(forms.Form):
    """The answers; of a registered study with the reason of the new version that they make."""

    reason = forms.CharField(
        label=_("why it is changed"), max_length=1000, widget=forms.Textarea(attrs={"rows": 2})
    )

    def __init__(self, *args: Any, study: Study, **options: Any) -> None:
        super().__init__(*args, **options)
        self.initial = dict(study.facts)
        if study.is_draft:
            del self.fields["reason"]
        for slug, question in ASKED.items():
            self.fields[slug] = forms.CharField(
                label=question,
                max_length=LETTERS_MAX,
                required=False,
                widget=forms.Textarea(attrs={"rows": 2}),
            )

    @property
    def facts(self) -> dict[str, str]:
        """What was answered."""
        return {slug: self.cleaned_data[slug] for slug in ASKED if self.cleaned_data[slug]}


class AdverseEventForm(forms.ModelForm):
    """How an event is judged; whose it is, where no log tells it."""

    class Meta:
        model = AdverseEvent
        fields = ("enrollment", "what", "grade", "serious", "relation", "expected")

    def __init__(self, *args: Any, study: Study, by: User, **options: Any) -> None:
        super().__init__(*args, **options)
        fields: dict[str, Any] = self.fields
        seen = Enrollment.objects.visible_to(by).filter(study=study).order_by("pk")
        fields["enrollment"].queryset = seen
        fields["enrollment"].label = _("Participant")

    def clean(self) -> Any:
        """Return the answers. Refuses the patient's name: researchers and monitors read them."""
        data: Any = super().clean()
        if data.get("what") and data.get("enrollment"):
            try:
                refuse_names(data["what"], data["enrollment"].patient)
            except ValidationError as problem:
                self.add_error("what", problem)
        return data
