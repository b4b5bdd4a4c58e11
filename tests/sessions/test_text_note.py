"""A session as text for the clinic's own record."""

from __future__ import annotations

import re

import pytest
from django.core.exceptions import ValidationError

from rehab.people.models.clinics import NOTE_PLACEHOLDERS
from rehab.people.roles import Role
from rehab.sessions.assessment_results import Assessment
from rehab.sessions.log import SessionEvent
from rehab.sessions.reports.text_note import usual_template
from tests.support.walks import HIT, MISS, walk
from tests.support.world import client_of

pytestmark = pytest.mark.django_db


def read(world, session, role=Role.PT):
    page = client_of(world, role).get(f"/sessions/{session.pk}/details/").content.decode()
    found = re.search(r'id="text-note">(.*?)</pre>', page, re.DOTALL)
    return found[1].replace("\N{NO-BREAK SPACE}", " ") if found else None


def test_it_says_what_was_walked_and_leaves_out_what_was_not_noted(world):
    Assessment.everywhere.all().delete()
    session = walk(world.patient, "binary", [HIT, MISS])
    text = read(world, session)
    assert f", {world.patient.code}\n" in text
    assert "2 strides, feedback Binary" in text
    assert not re.search("Noted|Tests|Walked with|{", text)
    for kind, value in (("borg", 4), ("orthosis", 1)):
        SessionEvent.everywhere.create(
            session=session, after_number=0, kind=kind, value=value, at=session.created_at
        )
    text = read(world, session)
    assert "Walked with: orthosis" in text
    assert "Noted: Exertion 4 of 10 (" in text
    assert read(world, session, Role.RESEARCHER) is None


def test_a_clinic_has_its_own_words(world):
    world.clinic.note_template = "PT {name}: {walked}\n{tests}"
    world.clinic.full_clean()
    world.clinic.save()
    session = walk(world.patient, "positive", [HIT, HIT])
    assert read(world, session).startswith(f"PT {world.patient.nickname}: ")
    world.clinic.note_template = "{diagnosis}"
    with pytest.raises(ValidationError, match="diagnosis"):
        world.clinic.full_clean()


def test_the_usual_words_have_known_places():
    places = set(re.findall(r"{(\w+)}", usual_template()))
    assert places <= set(NOTE_PLACEHOLDERS)
