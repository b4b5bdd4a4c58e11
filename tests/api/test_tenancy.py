"""Every call of the API, found in its own description, tried by every program of every clinic.

The matrix of tests/people/test_tenancy.py reads the API as browsers do; here programs read, add
and change, and a row of another clinic is never theirs.
"""

from __future__ import annotations

import json
import re
from collections import Counter
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from django.db.models import Model
from django.test import Client

from rehab.boards.models import Leaderboard
from rehab.people import api as people_api
from rehab.people.models import Patient, User
from rehab.people.roles import Role
from rehab.sessions.models import TrainingSession
from tests.support.identities import find_identities, identifying_texts
from tests.support.marks import mark
from tests.support.programs import ROOT, program_of
from tests.support.world import Actor, World, build_world, scoped_models, signed_in

pytestmark = pytest.mark.django_db

KEYS = {
    "patient_id": lambda world: world.rows[Patient].pk,
    "session_id": lambda world: world.rows[TrainingSession].pk,
    "board_id": lambda world: world.rows[Leaderboard].pk,
    "code": lambda world: world.rows[Patient].code,
    "fhir_id": lambda world: f"patient-{world.rows[Patient].pk}",
    "fhir_type": lambda _world: "Nothing",
}
# Bodies that would work on a row of one's own. A call that is not here takes none.
BODIES: dict[str, Any] = {
    "POST /patients": {"code": "K1", "nickname": "Rosa"},
    "PATCH /patients/{patient_id}": {"nickname": "Rosa"},
    "POST /users/{code}": {"name": "Rosa"},
    "POST /sessions": {"patient": "patient_id"},
    "POST /sessions/{session_id}/changes": {"kind": "goal", "value": 1.5},
}
# What a user of a clinic may create by an address that another clinic's row also has.
OWN_NAMES = {"POST /users/{code}"}


def described() -> dict[str, Any]:
    text = Client().get(f"{ROOT}/openapi.json").content
    return dict(json.loads(text))


def calls() -> Iterator[str]:
    for path, methods in described()["paths"].items():
        for method in methods:
            yield f"{method.upper()} {path.removeprefix(ROOT)}"


def find_leaks(worlds: tuple[World, World]) -> tuple[list[str], Counter[str]]:
    """Make every call as every program. Return what they should not have got, and counts."""
    before = [snapshot(world) for world in worlds]
    counts: Counter[str] = Counter()
    leaks: list[str] = []
    for mine, theirs in (worlds, worlds[::-1]):
        for role in mine.people:
            program = program_of(mine, role)
            reader = Actor(f"{role} of {mine.name}", mine.people[role], mine.name, role)
            hidden = identifying_texts(reader)
            for call in calls():
                method, path = call.split()
                body = dict(BODIES.get(call, {}))
                if body.get("patient"):
                    body["patient"] = theirs.patient.pk
                address = ROOT + path.format(**{name: get(theirs) for name, get in KEYS.items()})
                names_theirs = "{" in path or "patient" in body
                response = program.client.generic(
                    method, address, json.dumps(body), "application/json"
                )
                counts[call] += 1
                text = response.content.decode()
                label = f"{role} of {mine.name}: {call} {response.status_code}"
                if response.status_code >= 500 or response.status_code == 405:
                    leaks.append(f"{label} fails")
                if names_theirs and call not in OWN_NAMES and response.status_code < 400:
                    leaks.append(f"{label} opens")
                own = ROOT + path.format(**{name: get(mine) for name, get in KEYS.items()})
                answers = text + (program.client.get(own).content.decode() * (method == "GET"))
                leaks += [f"{label} names {whose}" for whose in find_identities(hidden, answers)]
                leaks += [
                    f"{label} shows {model.__name__}"
                    for model in scoped_models()
                    if mark(theirs.name, model) in text
                    # A name that the caller chose, of a row that is now the caller's own.
                    and not (call in OWN_NAMES and model is Patient)
                ]
                Patient.everywhere.filter(clinic=mine.clinic).exclude(pk=mine.patient.pk).delete()
    for world, then in zip(worlds, before, strict=True):
        if snapshot(world) != then:
            leaks.append(f"rows of {world.name} were changed")
    return leaks, counts


@pytest.mark.wide
def test_no_program_reads_or_changes_anything_of_another_clinic(capsys):
    worlds = build_world("amber"), build_world("birch")
    leaks, counts = find_leaks(worlds)
    assert leaks == []
    assert set(BODIES) <= set(counts)
    with capsys.disabled():
        print(f"\nAPI: {len(counts)} calls × {2 * len(worlds[0].people)} programs")


# --- the matrix can fail: seeded leaks ------------------------------------------------------------


@pytest.mark.long
def test_calls_that_ignore_whose_rows_they_read_and_change_are_caught(monkeypatch):
    monkeypatch.setattr(people_api, "patients_of", lambda user: Patient.everywhere.order_by("pk"))
    leaks, _ = find_leaks((build_world("amber"), build_world("birch")))
    for leak in (
        "pt of birch: GET /patients 200 shows Patient",
        "pt of birch: GET /patients/{patient_id} 200 opens",
        "pt of birch: PATCH /patients/{patient_id} 200 opens",
        "rows of amber were changed",
    ):
        assert leak in leaks


def snapshot(world: World) -> list[Any]:
    """Return a clinic's rows as they are."""
    rows: dict[type[Model], Any] = {kind: row.pk for kind, row in world.rows.items()}
    seen = (Patient, TrainingSession, Leaderboard)
    return [list(kind.everywhere.filter(pk=rows[kind]).values()) for kind in seen]


def test_every_call_says_what_it_may_answer_and_the_documented_ones_are_there():
    text = (Path(__file__).parents[2] / "docs" / "api.md").read_text()
    named = set(re.findall(r"`((?:GET|POST|PATCH|PUT|DELETE) /[^`]*)`", text))
    assert named <= set(calls())
    for path, methods in described()["paths"].items():
        for method, call in methods.items():
            assert {"401", "403", "422", "429"} <= set(call["responses"]), (method, path)
            assert call["security"] == [{"TokenAuth": []}, {"SessionAuth": []}]


def test_a_host_reads_nothing_but_who_it_is():
    host = signed_in(User.everywhere.create_user("root", role=Role.HOST))
    world = build_world("amber")
    for call in calls():
        method, path = call.split()
        if method == "GET":
            address = ROOT + path.format(**{name: get(world) for name, get in KEYS.items()})
            address += "?before=2026-01-01T00:00:00Z"  # which some calls require
            assert host.get(address).status_code == (200 if path == "/me" else 403), call
