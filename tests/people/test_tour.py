"""Where the tour is, by what a browser has kept and by the page; nonsense is no tour."""

from __future__ import annotations

import pytest
from django.urls import reverse

from rehab.people.roles import Role
from rehab.people.web.tour import COOKIE, STEPS
from tests.support.world import signed_in

pytestmark = pytest.mark.django_db


def page(client, name: str, kept: object, *arguments: object) -> str:
    client.cookies[COOKIE] = str(kept)
    return str(client.get(reverse(name, args=arguments)).content.decode())


def test_a_page_of_a_later_step_is_that_step(world):
    assert 'data-tour="1"' in page(world.pt, "start", 1)
    assert 'data-tour="2"' in page(world.pt, "patient", 1, world.patient.pk)
    assert 'data-tour="3"' in page(world.pt, "monitor", 1, world.session.pk)
    assert 'data-tour="5"' in page(world.pt, "monitor", 5, world.session.pk)
    assert 'data-tour="7"' in page(world.pt, "session", 3, world.session.pk)
    assert 'data-tour="5"' in page(world.pt, "caseload", 5)


@pytest.mark.parametrize("kept", ["", "0", "-3", "99", "3x", "³", "9" * 5000, "1e1"])
def test_who_left_it_or_has_none_sees_nothing_of_it(world, kept):
    assert "data-tour=" not in page(world.pt, "start", kept)


def test_a_tour_that_was_left_goes_on_from_the_help(world):
    assert 'data-tour-to="5"' in page(world.pt, "help", -5)
    assert "data-tour-to" not in page(signed_in(world.people[Role.RESEARCHER]), "help", -5)


def test_the_last_step_ends_it(world):
    assert 'data-tour-to="0"' in page(world.pt, "first-steps", len(STEPS))
