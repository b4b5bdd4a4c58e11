"""The description of the API: for everybody on one machine, for members where it is hosted."""

from __future__ import annotations

import pytest
from django.test import Client

from rehab.people.roles import Role
from tests.support.programs import ROOT, bearer_token

pytestmark = pytest.mark.django_db


def test_a_stranger_reads_it_on_one_machine_alone(settings):
    for hosted, statuses in ((False, [200, 200]), (True, [401, 302])):
        settings.HOSTED = hosted
        answers = [Client().get(f"{ROOT}/{page}") for page in ("openapi.json", "docs")]
        assert [answer.status_code for answer in answers] == statuses
    assert "Authorization" in answers[0].json()["message"]
    assert answers[1].headers["Location"].startswith("/sign-in/?next=")


def test_hosted_who_has_signed_in_reads_it_and_so_does_a_program(world, settings):
    settings.HOSTED = True
    program = Client(
        headers={"Authorization": f"Bearer {bearer_token(world.people[Role.PT], Role.PT)}"}
    )
    for reader in (world.pt, program):
        assert reader.get(f"{ROOT}/openapi.json").json()["info"]["title"] == "GARRY"
    assert world.pt.get(f"{ROOT}/docs").status_code == 200
    stranger = Client(headers={"Authorization": "Bearer nothing"})
    assert stranger.get(f"{ROOT}/openapi.json").status_code == 401
