"""The guide is served, and each page opens its part of it."""

import re

import pytest
from django.apps import apps
from django.urls import get_resolver

from rehab.people.models import User
from rehab.people.roles import Role
from rehab.people.web.help_pages import PARTS
from tests.support.tenancy import walk_patterns

pytestmark = pytest.mark.django_db


def test_each_page_opens_a_part_of_the_guide_that_is_there(world):
    client = world.pt
    guide = client.get("/help/").content.decode()
    headings = set(re.findall(r'<h[123] id="([^"]+)"', guide))
    assert set(PARTS.values()) <= headings
    names = {name for name, _, _ in walk_patterns(get_resolver())}
    assert set(PARTS) <= names | {f"rehab_{model}" for model in apps.all_models["rehab"]}
    assert 'href="/help/#today"' in client.get("/start/").content.decode()
    monitor = client.get(f"/sessions/{world.session.pk}/monitor/").content.decode()
    assert 'href="/help/#watch-and-steer"' in monitor
    gestures = client.get("/admin/rehab/composedgesture/").content.decode()
    assert 'href="/help/#the-robot"' in gestures


def test_who_reads_another_language_is_told_that_the_guide_is_in_english(world):
    assert "in English" not in world.pt.get("/help/").content.decode()
    User.everywhere.filter(pk=world.people[Role.PT].pk).update(language="de")
    page = world.pt.get("/help/").content.decode()
    assert '<p class="muted">' in page.split('class="guide ')[1].split("<h1")[0]


def test_pages_show_their_pictures_and_lead_only_to_pages_that_are_here(world):
    guide = world.pt.get("/help/").content.decode().split('class="guide ')[1]
    assert len(re.findall(r'<img [^>]*src="/static/docs/', guide)) > 8
    assert 'src="images/' not in guide
    assert ".md)" not in guide
    pages = set(re.findall(r'href="(/help/[a-z-]+/)', guide))
    assert {"/help/sources/", "/help/safety/"} <= pages
    for page in pages:
        read = world.pt.get(page).content.decode().split('class="guide ')[1]
        assert "<h1" in read
        assert not re.findall(r'href="(?!#|http|/)[^"]*"', read)
    assert world.pt.get("/help/nowhere/").status_code == 404


def test_pages_name_commands_and_the_address_as_they_are_here(world, settings):
    settings.PROGRAM, settings.IS_INSTALLED = "garry", True
    for page in ("", "security/"):
        read = world.pt.get(f"/help/{page}", headers={"host": "localhost:8765"}).content.decode()
        assert "manage.py" not in read
        assert "make run" not in read
        assert ":8000" not in read
    assert (
        "localhost:8765/start/"
        in world.pt.get("/help/", headers={"host": "localhost:8765"}).content.decode()
    )
