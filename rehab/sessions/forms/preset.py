"""Storing a set-up as a preset."""

from __future__ import annotations

from typing import Any

from django.core.exceptions import ValidationError
from django.db import IntegrityError, transaction
from django.utils.translation import gettext

from rehab.people.access import clinic_of
from rehab.people.models import Patient, User
from rehab.sessions.forms.session import SessionForm
from rehab.sessions.presets import NAME_TAKEN, Preset

# Not of a preset: they belong to the person and the place.
PERSONAL = ("station", "trained_side")


def save_preset(data: Any, patient: Patient, by: User, name: str) -> Preset:
    """Keep what stands in a set-up under a name; without one, under words that say what it is.

    Raises ValidationError for what could not be walked, and for a name that is taken.
    """
    form = SessionForm(data, patient=patient, by=by)
    for field in PERSONAL:
        del form.fields[field]
    if not form.is_valid():
        raise ValidationError([words for errors in form.errors.values() for words in errors])
    chosen = form.cleaned_data
    kinds = {slug for slug, _words in Preset._meta.get_field("source").flatchoices}
    preset = Preset(
        clinic=clinic_of(by),
        name=name,
        **chosen | {"source": chosen["source"] if chosen["source"] in kinds else ""},
    )
    if not name:
        preset.name = _find_name(preset.about, by)
    preset.full_clean()
    try:
        with transaction.atomic():
            preset.save()
    except IntegrityError as problem:  # somebody was quicker
        raise ValidationError(gettext(NAME_TAKEN)) from problem
    return preset


def _find_name(words: str, by: User) -> str:
    """Give a name that no preset has: the words, or the words with a number."""
    taken = set(Preset.objects.visible_to(by).values_list("name", flat=True))
    names = (words, *(f"{words} ({number})" for number in range(2, len(taken) + 3)))
    return next(name for name in names if name not in taken)
