"""Texts of a session that name no patient: researchers read them."""

from __future__ import annotations

import re

from django.core.exceptions import ValidationError
from django.utils.translation import gettext

from rehab.people.models import Patient


def refuse_names(text: str, *patients: Patient) -> str:
    """Return the text. Raises ValidationError where it has a patient's nickname or code."""
    for patient in patients:
        for name in (patient.nickname, patient.code):
            if re.search(rf"(?<!\w){re.escape(name)}(?!\w)", text, re.IGNORECASE):
                raise ValidationError(
                    gettext("Leave out “%(name)s”: researchers read this too."),
                    params={"name": name},
                )
    return text
