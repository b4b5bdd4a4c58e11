"""The check of letters proposes a setting; a therapist confirms it."""

from __future__ import annotations

import re

import pytest

from rehab.patients.screen_check import LEFT, LETTERS, RIGHT, SIZES, Proposal, propose
from rehab.people.models import Patient, ScreenSide, ScreenText
from tests.support.world import client_of

NORMAL, LARGE, LARGEST = SIZES


def seen(rule):
    return [rule(one) for one in LETTERS]


@pytest.mark.parametrize(
    ("rule", "proposal"),
    [
        (lambda _one: True, Proposal(NORMAL, None)),
        (lambda _one: False, Proposal(LARGEST, None)),
        (lambda one: one.size != NORMAL, Proposal(LARGE, None)),
        (lambda one: one.size == LARGEST, Proposal(LARGEST, None)),
        (lambda one: one.size == NORMAL, Proposal(LARGEST, None)),  # guessed, or not looked at
        (lambda one: one.side == RIGHT, Proposal(NORMAL, ScreenSide.IN_RIGHT)),
        (lambda one: one.side == LEFT, Proposal(NORMAL, ScreenSide.IN_LEFT)),
        (
            lambda one: one.side == RIGHT or one.size == LARGEST,
            Proposal(NORMAL, ScreenSide.RIGHT),
        ),
        (
            lambda one: one.side == RIGHT and one.size != NORMAL,
            Proposal(LARGE, ScreenSide.IN_RIGHT),
        ),
    ],
)
def test_the_setting_follows_what_was_seen(rule, proposal):
    assert propose(seen(rule)) == proposal


def test_each_size_comes_twice_on_each_side():
    for size in SIZES:
        for side in (LEFT, RIGHT):
            assert sum((one.size, one.side) == (size.value, side) for one in LETTERS) == 2


@pytest.mark.django_db
def test_nothing_is_set_before_the_therapist_saves(world):
    client, address = client_of(world), f"/patients/{world.patient.pk}/screen/"
    assert client.get(f"{address}check/").status_code == 200
    word = "".join("1" if one.side == RIGHT else "0" for one in LETTERS)
    page = client.get(f"{address}?seen={word}").content.decode()
    assert "6 of 12 letters" in page
    form = client.get(f"{address}?seen={word}").context["form"]
    assert form["screen_side"].value() == ScreenSide.IN_RIGHT
    stored = Patient.everywhere.get(pk=world.patient.pk)
    assert (stored.screen_side, stored.screen_text) == (ScreenSide.RIGHT, ScreenText.NORMAL)
    for nonsense in ("1", "x" * 12, "1" * 13):
        assert "letters were seen" not in client.get(f"{address}?seen={nonsense}").content.decode()
    values = {name: form[name].value() for name in form.fields if form[name].value()}
    client.post(address, values | {"language": "es"})
    stored.refresh_from_db()
    assert (stored.screen_side, stored.language) == (ScreenSide.IN_RIGHT, "es")


@pytest.mark.django_db
def test_a_screen_that_was_not_measured_is_offered_to_be(world):
    client = client_of(world)
    page = client.get(f"/patients/{world.patient.pk}/screen/check/").content.decode()
    assert "the patient wears the usual glasses" in page
    [address] = re.findall(r'big wide" href="([^"]+)">\s*Measure this screen first</a>', page)
    assert "Begin without measuring" in page
    measured = client.post(address, {"px_per_mm": "5.884", "distance_m": "2.0"})
    page = client.get(measured.headers["Location"]).content.decode()
    assert "Measure this screen first" not in page
    assert "data-begin>Begin<" in page
