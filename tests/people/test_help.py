"""The guide is served, and each page opens its part of it."""

import re

import pytest
from django.apps import apps
from django.urls import get_resolver

from rehab.people.models import User
from rehab.people.roles import Role
from rehab.people.web.help_pages import PARTS, using_guide
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


def test_guide_shows_its_pictures_and_leads_nowhere_else(world):
    guide = using_guide()
    assert len(re.findall(r'<img [^>]*src="/static/docs/', guide)) > 8
    assert 'src="images/' not in guide
    assert not re.findall(r'href="[^#h][^"]*"', guide)
