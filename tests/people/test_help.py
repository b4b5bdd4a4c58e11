"""The guide is served, and each page opens its part of it."""

import re

import pytest
from django.urls import get_resolver

from rehab.people.web.help_pages import PARTS, using_guide
from tests.support.tenancy import walk_patterns
from tests.support.world import client_of

pytestmark = pytest.mark.django_db


def test_each_page_opens_a_part_of_the_guide_that_is_there(world):
    client = client_of(world)
    guide = client.get("/help/").content.decode()
    headings = set(re.findall(r'<h[123] id="([^"]+)"', guide))
    assert set(PARTS.values()) <= headings
    names = {name for name, _, _ in walk_patterns(get_resolver())}
    assert set(PARTS) <= names
    assert 'href="/help/#today"' in client.get("/start/").content.decode()
    monitor = client.get(f"/sessions/{world.session.pk}/monitor/").content.decode()
    assert 'href="/help/#watch-and-steer"' in monitor


def test_guide_shows_its_pictures_and_leads_nowhere_else(world):
    guide = using_guide()
    assert len(re.findall(r'<img [^>]*src="/static/docs/', guide)) > 8
    assert 'src="images/' not in guide
    assert not re.findall(r'href="[^#h][^"]*"', guide)
