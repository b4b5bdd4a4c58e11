"""What an export holds, and for whom."""

from __future__ import annotations

from typing import Any

from django import forms
from django.conf import settings
from django.utils.text import capfirst
from django.utils.translation import gettext_lazy as _

from rehab.exports.encryption import InvalidKey, read_recipients
from rehab.people.models import User
from rehab.studies.models import Study, StudyState


class ResearchExportForm(forms.Form):
    """Which sessions, and whether dates are moved."""

    study: forms.ModelChoiceField[Study] = forms.ModelChoiceField(
        queryset=None, required=False, empty_label=_("all sessions")
    )
    shift_dates = forms.BooleanField(
        label=_("Shift dates by whole weeks, differently for each patient"),
        help_text=_("Days then give less away; weekdays and intervals stay."),
        required=False,
        initial=True,
    )

    def __init__(self, *args: Any, by: User, **options: Any) -> None:
        super().__init__(*args, **options)
        study: Any = self.fields["study"]
        study.label = capfirst(_("study"))
        study.queryset = Study.objects.visible_to(by).exclude(state=StudyState.DRAFT)


class ClinicExportForm(forms.Form):
    """Who can open a clinic's sealed file."""

    keys = forms.CharField(
        label=_("Public keys of who takes it in (age1…), one a line"),
        help_text=_("The other host makes a pair of keys and gives you the public one."),
        widget=forms.Textarea({"rows": 2}),
        max_length=1000,
    )
    tokens = forms.BooleanField(
        label=_("With the tokens of devices, programs and families"), required=False
    )

    def clean_keys(self) -> str:
        """Return keys that are valid, of those that the server's settings name.

        A host sees no patient: who can only sign in must not choose who opens the file.
        """
        keys: str = self.cleaned_data["keys"]
        try:
            read_recipients(keys.split())
        except InvalidKey as problem:
            raise forms.ValidationError(str(problem)) from problem
        if not {*keys.split()} <= {*settings.BACKUP_KEYS, *settings.MOVE_KEYS}:
            raise forms.ValidationError(
                _("Name this key in the server’s setting GARRY_MOVE_KEYS first, and restart it.")
            )
        return keys


class ClinicRemovalForm(forms.Form):
    """What says that a clinic is elsewhere."""

    receipt = forms.RegexField(
        label=_("Receipt of the installation that took it in"), regex="^[0-9a-f]{64}$"
    )
