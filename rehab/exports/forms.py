"""What an export for analysis holds."""

from __future__ import annotations

from typing import Any

from django import forms
from django.utils.text import capfirst
from django.utils.translation import gettext_lazy as _

from rehab.people.models import User
from rehab.studies.models import Study, StudyState


class ResearchExportForm(forms.Form):
    """Which sessions, and whether dates are moved."""

    study: forms.ModelChoiceField[Study] = forms.ModelChoiceField(
        queryset=None, required=False, empty_label=_("all sessions")
    )
    shift_dates = forms.BooleanField(
        label=_("Shift dates by whole weeks, differently for each patient"),
        required=False,
        initial=True,
    )

    def __init__(self, *args: Any, by: User, **options: Any) -> None:
        super().__init__(*args, **options)
        study: Any = self.fields["study"]
        study.label = capfirst(_("study"))
        study.queryset = Study.objects.visible_to(by).exclude(state=StudyState.DRAFT)
