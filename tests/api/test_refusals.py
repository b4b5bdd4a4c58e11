"""Whatever the API refuses has one shape: JSON with a message and fields (docs/api.md)."""

from __future__ import annotations

import json
import re
from typing import Any

import pytest
from django.core.exceptions import PermissionDenied, SuspiciousOperation
from django.test import Client

from rehab.people import api as people_api
from rehab.people.models import User
from rehab.people.roles import Role
from tests.support.programs import ROOT, program_of
from tests.support.world import World

pytestmark = pytest.mark.django_db
METHODS = ("get", "post", "put", "patch", "delete", "options")


def problem_of(response: Any, status: int) -> dict[str, Any]:
    assert response.status_code == status, response.content
    assert response.headers["Content-Type"].startswith("application/json")
    problem = dict(json.loads(response.content))
    assert problem.keys() == {"message", "fields"}
    assert re.search(r"\w", problem["message"])
    return problem


@pytest.fixture
def program(world: World) -> Client:
    return program_of(world, Role.PT).client


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("address", ["nothing", "patients/1/more", "me/", "", "../v1", "a%00b"])
def test_an_address_that_no_call_has(program, method, address):
    for client in (program, Client()):
        problem = problem_of(getattr(client, method)(f"{ROOT}/{address}"), 404)
        assert "/api/v1/docs" in problem["message"]


def test_a_method_that_an_address_does_not_take(program):
    response = program.delete(f"{ROOT}/patients")
    assert "GET, POST" in problem_of(response, 405)["message"]
    assert response["Allow"] == "GET, POST"


def test_a_body_that_is_too_long(program):
    body = json.dumps({"code": "K" * 3_000_000})
    problem_of(program.post(f"{ROOT}/patients", body, "application/json"), 413)


@pytest.mark.parametrize(
    ("fault", "status"),
    [
        (RuntimeError("Traceback: secret"), 500),
        (PermissionDenied(), 403),
        (SuspiciousOperation("secret"), 400),
    ],
    ids=["failure", "denied", "suspicious"],
)
def test_what_fails_within_a_call_says_nothing_of_the_inside(program, monkeypatch, fault, status):
    def fail(user: User) -> None:
        raise fault

    monkeypatch.setattr(people_api, "patients_of", fail)
    response = program.get(f"{ROOT}/patients")
    problem_of(response, status)
    assert b"secret" not in response.content
