"""Presets from the set-up form."""

from __future__ import annotations

from typing import Any

from django.core.exceptions import ValidationError
from django.db import IntegrityError, transaction
from django.utils.translation import gettext

from rehab.people.access import clinic_of
from rehab.people.models import Patient, User
from rehab.sessions.forms.setup import SessionForm
from rehab.sessions.setup.options import preset_options
from rehab.sessions.setup.presets import NAME_TAKEN, SOURCES, Preset

# Fields of the set-up that no preset has: they depend on the patient and the place.
EXCLUDED_FIELDS = ("station", "trained_side")


def save_preset(data: Any, patient: Patient, by: User, name: str) -> Preset:
    """Store a set-up under a name, or else under its summary.

    Raises ValidationError for a set-up that could not be walked, and for a name that is taken.
    """
    form = SessionForm(data, patient=patient, by=by)
    for field in EXCLUDED_FIELDS:
        del form.fields[field]
    if not form.is_valid():
        raise ValidationError([message for errors in form.errors.values() for message in errors])
    data = form.cleaned_data
    chosen = {option.name: form.chosen()[option.name] for option in preset_options()}
    if chosen["source"] not in SOURCES:
        chosen["source"] = ""
    preset = Preset(
        clinic=clinic_of(by),
        name=name,
        measure=data["measure"],
        protocol=data["protocol"],
        options=chosen,
    )
    if not name:
        preset.name = _free_name(preset.summary, by)
    preset.full_clean()
    try:
        with transaction.atomic():
            preset.save()
    except IntegrityError as problem:  # another user has stored it meanwhile
        raise ValidationError(gettext(NAME_TAKEN)) from problem
    return preset


def _free_name(text: str, by: User) -> str:
    """Return a free name: the text, or the text with a number."""
    taken = set(Preset.objects.visible_to(by).values_list("name", flat=True))
    names = (text, *(f"{text} ({number})" for number in range(2, len(taken) + 3)))
    return next(name for name in names if name not in taken)
