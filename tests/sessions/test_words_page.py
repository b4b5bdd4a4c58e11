"""Words edited for one session: from the next step there, and nowhere else."""

from __future__ import annotations

import re

import pytest
from django.urls import reverse

from rehab.feedback.clinic_valences import valences_of
from rehab.people.roles import Role
from rehab.sessions.feedback_text_updates import change_language, session_language
from rehab.sessions.live.session.aggregate import SessionAggregate
from rehab.sessions.log import SessionEvent
from rehab.sessions.services import change_session
from rehab.training.changes import ChangeKind
from tests.support.walks import make_session
from tests.support.world import client_of, signed_in

pytestmark = pytest.mark.django_db(transaction=True)  # the writer has its own connection


def begin(world):
    session = make_session(world.patient)
    change_session(session, ChangeKind.START)
    session.refresh_from_db()
    return session


def words_of(session):
    return [band.words for band in SessionAggregate.load(session).fold.valence.bands]


def test_words_of_one_session_change_there_alone_and_who_did_it_is_logged(world):
    session, other = begin(world), begin(world)
    before, url = words_of(session), reverse("words", args=[session.pk])
    sent = {f"words_{number}": words for number, words in enumerate(before)}
    answer = client_of(world).post(url, sent | {"words_0": "Push, Ana!"})
    assert answer["Location"] == reverse("monitor", args=[session.pk])
    assert words_of(session) == ["Push, Ana!", *before[1:]]
    assert words_of(other) == before
    event = SessionEvent.everywhere.get(session=session, kind=ChangeKind.FEEDBACK_TEXT)
    assert event.by == world.people[Role.PT]
    page = client_of(world).get(url).content.decode()
    assert "Push, Ana!" in page
    assert reverse("admin:rehab_feedbacktype_changelist") in page


def test_words_go_to_the_type_that_they_were_typed_for(world):
    """Somebody changes the type while they are typed."""
    session = begin(world)
    before, url = words_of(session), reverse("words", args=[session.pk])
    shown = client_of(world).get(url).content.decode()
    sent = dict(re.findall(r'name="(valence)" value="([^"]*)"', shown))
    sent |= dict(re.findall(r'<textarea name="(words_\d+)"[^>]*>\s*([^<]*?)\s*</textarea>', shown))
    change_session(session, ChangeKind.VALENCE_NOW, "negative")
    negative = words_of(session)
    assert client_of(world).post(url, sent | {"words_0": "Push, Ana!"}).status_code == 302
    assert words_of(session) == negative
    change_session(session, ChangeKind.VALENCE_NOW, "positive")
    assert words_of(session) == ["Push, Ana!", *before[1:]]


def test_another_language_of_the_patient_is_that_of_the_open_session(world):
    session, ended = begin(world), begin(world)
    change_session(ended, ChangeKind.FINISH)
    before = words_of(ended)
    world.patient.language = "es"
    world.patient.save()
    assert change_language(world.patient, world.people[Role.PT]) == []
    fold, spanish = SessionAggregate.load(session).fold, valences_of(session.clinic_id, "es")
    assert fold.valences.known["negative"].bands == spanish["negative"].bands
    assert words_of(session) == [band.words for band in spanish["positive"].bands] != before
    assert (fold.valences.language, session_language(session)) == ("es", "es")
    assert (words_of(ended), session_language(ended)) == (before, "en")


def test_words_that_name_the_patient_are_refused(world):
    session = begin(world)
    before, url = words_of(session), reverse("words", args=[session.pk])
    for name in (world.patient.nickname, world.patient.code):
        answer = client_of(world).post(url, {"words_0": f"Push, {name.upper()}!"})
        assert "researchers read this too" in answer.content.decode()
    assert words_of(session) == before


def test_words_too_long_are_refused_and_an_ended_session_has_none_to_edit(world):
    session = begin(world)
    url = reverse("words", args=[session.pk])
    assert (
        "at most 60 characters"
        in client_of(world).post(url, {"words_0": "x" * 61}).content.decode()
    )
    change_session(session, ChangeKind.FINISH)
    answer = client_of(world).post(url, {"words_0": "late"}, follow=True)
    assert "nobody reads its words any more" in answer.content.decode()
    assert signed_in(world.people[Role.RESEARCHER]).get(url).status_code == 403
