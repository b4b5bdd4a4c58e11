"""Whatever is sent to a page: no failure, nobody else's rows, nothing of the inside, and soon."""

from __future__ import annotations

from urllib.parse import urlencode

import pytest
from django.urls import reverse

from rehab.people.models import User
from rehab.sessions.setup.protocol_models import Protocol
from tests.support.form_noise import run_noise
from tests.support.world import build_world


# tests/bench has 10,000.
@pytest.mark.wide
@pytest.mark.parametrize("requests", [30, pytest.param(230, marks=pytest.mark.long)])
@pytest.mark.django_db
def test_noise_to_every_form_fails_nowhere_and_leaks_nothing(capsys, requests):
    told = run_noise(requests)
    with capsys.disabled():
        print(f"\nForm noise: {told}")


HUGE = "9" * 5000  # Python reads no number of so many digits


@pytest.mark.django_db
@pytest.mark.parametrize(
    ("page", "query", "form", "status"),
    [
        ("add-recording-part", {"ending": ".csv", "at": HUGE}, {}, 400),
        ("remove-authenticator", {"which": HUGE}, {}, 302),
        ("confirm-reset", {}, {"which": HUGE}, 302),
        ("pair", {}, {"station": HUGE, "code": "ABCD"}, 200),
        ("leave", {}, {"station": HUGE}, 404),
    ],
)
def test_a_number_that_is_longer_than_any_key_is_no_failure(world, page, query, form, status):
    address = f"{reverse(page)}?{urlencode(query)}"
    assert world.lead.post(address, form).status_code == status


@pytest.mark.django_db
@pytest.mark.parametrize(
    ("model", "page", "status"),
    [
        (Protocol, "change", 200),
        (Protocol, "delete", 200),
        (User, "change", 200),
        (User, "delete", 403),
    ],
)
def test_a_form_that_names_no_field_to_find_its_row_by(model, page, status):
    world = build_world("amber")
    browser = world.lead
    name = f"admin:rehab_{model._meta.model_name}_{page}"
    address = reverse(name, kwargs={"object_id": world.rows[model].pk})
    assert browser.get(address, {"_to_field": ""}).status_code == status
