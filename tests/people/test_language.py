"""Which language a page has: of whoever looks at it, or of the patient who is to read it."""

from __future__ import annotations

import re

import pytest
from django.conf import settings
from django.test import Client
from django.urls import reverse
from django.utils import translation

from rehab.people.models import Patient, User
from rehab.people.roles import Role
from rehab.sessions.models import TrainingSession
from tests.support.world import World

pytestmark = pytest.mark.django_db


def spoken(client: Client, path: str, browser: str = "en") -> str:
    """Return the language that a page says it has, in its head and to the browser."""
    answer = client.get(path, headers={"Accept-Language": browser})
    found = re.search(r'<html lang="([^"]+)" dir="ltr">', answer.content.decode())
    assert found, answer.content[:200]
    assert answer.headers["Content-Language"] == found[1]
    if "/admin/" not in path:
        assert f'src="/js/{found[1]}/catalog.js"' in answer.content.decode()
    return found[1]


def clinic_speaks(world: World, language: str) -> None:
    world.clinic.language = language
    world.clinic.save()


def test_a_strangers_pages_have_the_browsers_language(client):
    assert spoken(client, "/", "es-MX, en;q=0.5") == "es"
    assert spoken(client, "/sign-in/", "fi") == "en"
    assert spoken(client, "/tablet/", "es") == "es"
    assert "Accept-Language" in client.get("/").headers["Vary"]


def test_an_accounts_pages_have_its_own_language_or_else_the_clinics(world, pt):
    clinic_speaks(world, "es")
    assert spoken(pt, "/start/") == "es"
    assert pt.post("/account/language/", {"language": "en"}).headers["Location"] == "/account/"
    assert spoken(pt, "/start/", "es") == "en"
    assert spoken(pt, "/admin/", "es") == "en"
    pt.post("/account/language/", {"language": ""})
    assert spoken(pt, "/start/") == "es"
    assert spoken(pt, "/sessions/0/", "en") == "es"  # there is no such session


def test_an_account_takes_no_language_that_there_is_not(world, pt):
    pt.post("/account/language/", {"language": "tlh"})
    assert User.everywhere.get(pk=world.people[Role.PT].pk).language == ""


def test_what_a_patient_reads_is_in_the_patients_language(world, pt):
    Patient.everywhere.filter(pk=world.patient.pk).update(language="es")
    open_one = TrainingSession.everywhere.get(pk=world.session.pk)
    open_one.pk, open_one.state, open_one.started_at = None, "ready", None
    open_one.save()
    tablet, _ = world.add_tablet()
    scores = reverse("scores", args=[world.session.pk])
    assert spoken(pt, scores) == spoken(tablet, scores) == "es"
    walk = reverse("walk", args=[open_one.pk])
    assert spoken(pt, walk) == spoken(tablet, walk) == "en"  # as the words of its plan
    assert spoken(pt, reverse("take-home", args=[world.patient.pk])) == "es"
    assert spoken(pt, reverse("monitor", args=[open_one.pk])) == "en"
    assert translation.get_language() == "en"  # the next request begins anew


def test_a_tablet_that_waits_speaks_as_its_clinic(world):
    clinic_speaks(world, "es")
    assert spoken(world.add_tablet()[0], "/tablet/") == "es"


def test_programs_are_answered_in_english(world, pt):
    clinic_speaks(world, "es")
    answer = pt.get("/api/v1/patients/", headers={"Accept-Language": "es"})
    assert answer.headers["Content-Language"] == "en"


def test_the_words_of_scripts_are_public_and_kept(client):
    for language, _name in settings.LANGUAGES:
        answer = client.get(f"/js/{language}/catalog.js")
        assert "django.gettext" in answer.content.decode()
        assert "max-age" in answer.headers["Cache-Control"]
        again = client.get(
            f"/js/{language}/catalog.js", headers={"If-None-Match": answer.headers["ETag"]}
        )
        assert again.status_code == 304
    assert client.get("/js/tlh/catalog.js").status_code == 404
