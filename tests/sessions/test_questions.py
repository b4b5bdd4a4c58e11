"""Questions after a session: planned, answered on the tablet, skipped, told."""

from __future__ import annotations

from datetime import timedelta

import pytest
from django.test import Client
from django.urls import reverse

from rehab.people.models import Patient
from rehab.people.roles import Role
from rehab.sessions.models import TrainingSession
from rehab.sessions.questionnaires import (
    Questionnaire,
    QuestionnaireResponse,
    answer,
    ask,
    find_instrument,
)
from rehab.sessions.setup.protocol_models import Protocol
from rehab.stations.models import Station
from rehab.training.measures import InvalidSetting
from tests.support.walks import make_session
from tests.support.world import NOW, World, build_world, client_of

pytestmark = pytest.mark.django_db


def planned(world: World, *slugs: str, language: str = "en") -> TrainingSession:
    """Return an ended session whose protocol asks questionnaires."""
    protocol = world.rows[Protocol]
    protocol.questionnaires = list(slugs)
    protocol.save()
    Patient.everywhere.filter(pk=world.patient.pk).update(language=language, screen_text="largest")
    session = make_session(
        Patient.everywhere.get(pk=world.patient.pk),
        protocol=protocol,
        measure=world.session.measure,
        station=world.rows[Station],
    )
    later = NOW + timedelta(seconds=1)
    session.state, session.started_at, session.ended_at = "finished", NOW, later
    session.save()
    return session


def tablet_of(world: World) -> Client:
    return world.add_tablet()[0]


def tap(client: Client, session: TrainingSession, **sent: object) -> int:
    response = session.questionnaires.filter(finished_at=None).first()
    sent = {"response": response.pk, "number": len(response.answers)} | sent
    return client.post(reverse("questions", args=[session.pk]), sent).status_code


def test_a_patient_answers_on_the_tablet_in_the_own_language_skips_and_goes_on(world):
    session = planned(world, "tlx", language="es")
    tablet, url = tablet_of(world), reverse("questions", args=[session.pk])
    assert f'href="{url}"' in tablet.get(reverse("ending", args=[session.pk])).content.decode()
    page = tablet.get(url).content.decode()
    assert "exigencia mental" in page
    assert 'data-text="largest"' in page
    assert tap(tablet, session, value=35) == 302
    assert tap(tablet, session, skip="") == 302
    back = tablet.get(f"{url}?back=1").content.decode()
    assert "exigencia mental" in back
    assert "checked" in back
    assert tap(tablet, session, number=0, value=40) == 302
    for value in (0, 100, 50, 55):
        assert tap(tablet, session, value=value) == 302
    response = session.questionnaires.get()
    assert response.answers == [40, None, 0, 100, 50, 55]
    assert response.finished_at is not None
    assert response.score is None  # one is missing
    done = tablet.get(url)
    assert done["Location"] == reverse("scores", args=[session.pk])


@pytest.mark.parametrize(
    "sent", [{"value": "7"}, {"value": ""}, {"value": "٣"}, {"number": 3, "value": 5}]
)
def test_what_is_no_answer_is_refused_and_nothing_is_stored(world, sent):
    session = planned(world, "tlx")
    assert tap(client_of(world), session, **sent) == 400
    assert session.questionnaires.get().answers == []


def test_a_form_of_another_questionnaire_changes_nothing(world):
    session = planned(world, "tlx", "sus")
    tap(client_of(world), session, response=10**8, value=5)
    assert [row.answers for row in session.questionnaires.all()] == [[], []]


def test_stopping_ends_one_questionnaire_and_keeps_its_answers(world):
    session = planned(world, "tlx", "sus")
    client = client_of(world)
    tap(client, session, value=5)
    tap(client, session, stop="")
    first, second = session.questionnaires.all()
    assert (first.answers, first.finished_at is None) == ([5], False)
    assert second.finished_at is None
    with pytest.raises(InvalidSetting, match="Load the page again"):
        answer(first, 1, 5, NOW)


def test_own_questions_keep_their_words_for_earlier_answers(world):
    own = world.rows[Questionnaire]
    session = planned(world, own.slug)
    Questionnaire.everywhere.filter(pk=own.pk).update(items="Hungry? | no | very | 5")
    client = client_of(world)
    assert "Zqtiredqz" in client.get(reverse("questions", args=[session.pk])).content.decode()
    tap(client, session, value=4)
    details = client.get(reverse("session", args=[session.pk])).content.decode()
    assert "4 (1 to 5)" in details
    assert "Zqtiredqz" in client.get(reverse("report", args=[session.pk])).content.decode()


def test_a_deleted_questionnaire_stops_the_set_up_with_a_cure(world):
    with pytest.raises(InvalidSetting, match="choose its questionnaires again"):
        planned(world, "own-987654")


def test_a_therapist_asks_afterwards_once(world):
    session = world.session
    client, url = client_of(world), reverse("add-questionnaire", args=[world.session.pk])
    QuestionnaireResponse.everywhere.filter(session=session).delete()
    for _ in range(2):
        assert client.post(url, {"questionnaire": "sus"})["Location"].endswith("/questions/")
    assert session.questionnaires.count() == 1
    client.post(url, {"questionnaire": "own-99999"})
    assert session.questionnaires.count() == 1


def test_another_clinics_questionnaire_is_neither_offered_nor_asked(world):
    other = build_world("other")
    page = client_of(world).get(reverse("session", args=[world.session.pk])).content.decode()
    assert other.rows[Questionnaire].name not in page
    with pytest.raises(InvalidSetting):
        ask(world.session, [other.rows[Questionnaire].slug], NOW)
    assert find_instrument(world.rows[Questionnaire].slug, world.clinic.pk, "en")


def test_the_admin_offers_what_a_protocol_can_ask(world):
    lead, protocol = client_of(world, Role.LEAD), world.rows[Protocol]
    page = lead.get(reverse("admin:rehab_protocol_change", args=[protocol.pk])).content.decode()
    for name in ("NASA-TLX (raw)", world.rows[Questionnaire].name):
        assert name in page
