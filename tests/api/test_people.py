"""Patients over the API: the same rows by the same rules as on the pages."""

from __future__ import annotations

import pytest

from rehab.people.models import Patient
from rehab.people.roles import Role
from tests.support.programs import Program, program_of
from tests.support.world import World

pytestmark = [pytest.mark.django_db, pytest.mark.postgres]


@pytest.fixture
def pt(world: World) -> Program:
    return program_of(world, Role.PT)


def test_a_program_learns_whom_it_speaks_for(world, pt):
    assert pt.get("/me") == (
        200,
        {
            "username": world.people[Role.PT].username,
            "role": "pt",
            "clinic": world.clinic.name,
        },
    )


def test_a_patient_is_added_read_and_mended(world, pt):
    status, rosa = pt.post("/patients", code="K7-204", nickname="Rosa", paretic_side="left")
    assert status == 201
    assert rosa["pseudonym"].startswith("P-")
    stored = Patient.everywhere.get(pk=rosa["id"])
    assert (stored.clinic, stored.paretic_side, stored.language) == (world.clinic, "left", "en")
    assert pt.get(f"/patients/{rosa['id']}") == (200, rosa)
    status, mended = pt.patch(f"/patients/{rosa['id']}", paretic_side="right", body_mass_kg=71.5)
    assert (status, mended) == (200, rosa | {"paretic_side": "right", "body_mass_kg": 71.5})
    assert pt.get("/patients", code="K7-204") == (200, {"items": [mended], "total": 1})


@pytest.mark.parametrize(
    ("body", "status", "field", "words"),
    [
        ({"nickname": "Rosa"}, 422, "code", "required"),
        ({"code": "K1", "nickname": ""}, 422, "nickname", "at least 1"),
        ({"code": "K1", "nickname": "Ro\nsa"}, 422, "nickname", "one line"),
        ({"code": "K1", "nickname": "Rosa\x00"}, 422, "nickname", "one line"),
        ({"code": "K1", "nickname": "R" * 33}, 422, "nickname", "at most 32"),
        ({"code": 7, "nickname": "Rosa"}, 422, "code", "valid string"),
        ({"code": "K1", "nickname": "Rosa", "paretic_side": "up"}, 422, "paretic_side", "left"),
        ({"code": "K1", "nickname": "Rosa", "body_mass_kg": 7}, 422, "body_mass_kg", "10"),
        ({"code": "K1", "nickname": "Rosa", "goal": 1}, 422, "goal", "not permitted"),
        ({"code": "K1", "nickname": "Rosa", "language": "xx"}, 409, "language", "valid choice"),
        ({"code": "zqamberpatientqz", "nickname": "Rosa"}, 409, "", "already exists"),
    ],
)
def test_what_is_refused_says_why_and_stores_nothing(pt, body, status, field, words):
    before = Patient.everywhere.count()
    answer = pt.post("/patients", **body)
    assert answer[0] == status, answer
    assert words in (answer[1]["fields"][field] if field else answer[1]["message"])
    assert Patient.everywhere.count() == before


@pytest.mark.parametrize("body", ["", "{", "[]", "null", '"x"', "[" * 50_000, '{"code": 1e999}'])
def test_a_body_that_is_no_object_is_refused_in_words(pt, body):
    response = pt.client.post("/api/v1/patients", body, "application/json")
    assert response.status_code in (400, 422)
    assert response.json()["message"]


def test_lists_come_in_parts(world, pt):
    for number in range(5):
        pt.post("/patients", code=f"K{number}", nickname="Rosa")
    _, page = pt.get("/patients", limit=2, offset=3)
    assert ([row["code"] for row in page["items"]], page["total"]) == (["K2", "K3"], 6)
    assert pt.get("/patients", limit=1000)[0] == 422
    assert pt.get("/patients", offset=-1)[0] == 422


def test_the_papers_users_are_patients_by_their_code(pt, world):
    assert pt.post("/users/7", name="Rosa") == (201, {"id": "7", "name": "Rosa"})
    assert pt.get("/users/7") == (200, {"id": "7", "name": "Rosa"})
    assert Patient.everywhere.get(code="7").clinic == world.clinic
    status, problem = pt.post("/users/7", name="Joon")
    assert (status, "already exists" in problem["message"]) == (409, True)
    assert pt.get("/users/8")[0] == 404


def test_researchers_read_no_patient(world):
    program = program_of(world, Role.RESEARCHER)
    for path in ("/patients", f"/patients/{world.patient.pk}", f"/users/{world.patient.code}"):
        status, problem = program.get(path)
        assert status == 403
        assert "Clinic lead or Physical therapist" in problem["message"]


def test_of_two_who_take_a_code_at_once_one_is_refused(pt, monkeypatch):
    monkeypatch.setattr(Patient, "full_clean", lambda self: None)  # neither sees the other yet
    assert pt.post("/patients", code="K1", nickname="Rosa")[0] == 201
    status, problem = pt.post("/patients", code="K1", nickname="Joon")
    assert (status, problem["fields"]["code"]) == (409, "This code has just been taken.")
