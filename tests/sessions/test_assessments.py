"""Standard tests on their pages: taken, listed with their course, struck out, exported once."""

from __future__ import annotations

from datetime import timedelta

import pytest
from django.urls import reverse

from rehab.exports.fhir.resources import Pseudonyms, make_bundle
from rehab.patients.erasure import erase
from rehab.people.models import ErasureReason
from rehab.people.roles import Role
from rehab.sessions.assessment_results import Assessment, assessments_with, load_courses
from rehab.sessions.available_tests import ClinicTest
from tests.support.walks import HIT, make_session, walk
from tests.support.world import NOW, build_world, client_of

pytestmark = pytest.mark.django_db


@pytest.fixture
def world(world):
    Assessment.everywhere.all().delete()
    return world


def take(world, slug, **data):
    return client_of(world).post(f"/patients/{world.patient.pk}/tests/{slug}/", data, follow=True)


@pytest.mark.parametrize(
    ("slug", "data", "value"),
    [
        ("10mwt", {"meters": "10", "measured": "12,5"}, 0.8),  # with a comma, as many write
        ("10mwt", {"meters": "6", "measured": "7.5"}, 0.8),
        ("6mwt", {"measured": "231"}, 231),
        ("tug", {"measured": "17.3", "device": "cane"}, 17.3),
        ("fac", {"measured": "3"}, 3),
        ("berg", {"measured": "41"}, 41),
    ],
)
def test_a_result_is_stored_as_measured(world, slug, data, value):
    page = take(world, slug, **data)
    assert page.redirect_chain[-1][0] == f"/patients/{world.patient.pk}/tests/"
    (row,) = Assessment.everywhere.all()
    assert row.test == slug
    assert row.value == pytest.approx(value)
    assert (row.device, row.by) == (data.get("device", ""), world.people[Role.PT])


@pytest.mark.parametrize(
    ("slug", "data", "cure"),
    [
        ("10mwt", {"meters": "10", "measured": "0.6"}, "Check what was measured"),  # 17 m/s
        ("10mwt", {"meters": "", "measured": "9"}, "required"),
        ("tug", {"measured": "0.4"}, "Give 2 to 600 s."),
        ("tug", {"measured": "fast"}, "Enter a number"),
        ("fac", {"measured": "7"}, "valid choice"),
        ("berg", {"measured": "40.5"}, "Check what was measured"),
    ],
)
def test_what_cannot_be_is_refused_with_the_cure(world, slug, data, cure):
    page = take(world, slug, **data)
    assert page.status_code == 200
    assert cure in page.content.decode()
    assert not Assessment.everywhere.exists()


def test_a_course_leaves_out_what_was_struck_out(world):
    for seconds in ("31", "99", "28"):
        take(world, "tug", measured=seconds)
    wrong = Assessment.everywhere.get(value=99)
    client = client_of(world)
    client.post(f"/patients/{world.patient.pk}/tests/strike-out/", {"result": wrong.pk})
    (course,) = [c for c in load_courses(world.people[Role.PT], world.patient) if c.results]
    assert (course.summary, course.verdict) == ("28.0 s, at first 31.0 s", 1)
    assert course.spark == ["4.0,28.0", "116.0,4.0"]
    assert course.ends == ("28.0 s", "31.0 s")  # at its top and at its foot: lower is better
    wrong.refresh_from_db()
    assert wrong.struck_at is not None
    for address, said in (("sessions", "28.0 s, at first 31.0 s"), ("tests", "at first 31.0 s")):
        assert said in client.get(f"/patients/{world.patient.pk}/{address}/").content.decode()
    assert client.get(f"/patients/{world.patient.pk}/tests/joy/").status_code == 404


@pytest.mark.parametrize(("slug", "usual"), [("tug", "8.2–10.2 s"), ("5sts", "up to 12.6 s")])
def test_what_is_usual_is_a_range_or_a_limit(world, slug, usual):
    world.patient.birth_year = NOW.year - 75
    courses = load_courses(world.people[Role.PT], world.patient)
    assert next(one.usual for one in courses if one.test.slug == slug) == usual


def test_another_clinic_neither_sees_nor_strikes_out(world):
    take(world, "tug", measured="31")
    row, other = Assessment.everywhere.get(), build_world("cobalt")
    stranger = client_of(other)
    address = f"/patients/{world.patient.pk}/tests/"
    assert stranger.get(address).status_code == 404
    assert stranger.post(f"{address}tug/", {"measured": "9"}).status_code == 404
    assert stranger.post(f"{address}strike-out/", {"result": row.pk}).status_code == 404
    own = f"/patients/{other.patient.pk}/tests/strike-out/"
    assert stranger.post(own, {"result": row.pk}).status_code == 302
    row.refresh_from_db()
    assert row.struck_at is None
    assert client_of(world, Role.RESEARCHER).get(address).status_code == 403


def test_each_result_goes_with_one_session(world):
    type(world.session).everywhere.filter(patient=world.patient).update(
        created_at=NOW - timedelta(days=20)
    )
    first = world.session
    first.refresh_from_db()
    later = make_session(world.patient)
    type(later).everywhere.filter(pk=later.pk).update(created_at=NOW - timedelta(days=5))
    later.refresh_from_db()
    for days_ago in (30, 20, 12, 5, 0):
        Assessment.everywhere.create(
            clinic=world.clinic,
            patient=world.patient,
            test="6mwt",
            value=200 + days_ago,
            at=NOW - timedelta(days=days_ago, hours=1),
        )
    values = [
        [row.value for row in assessments_with(world.people[Role.PT], session)]
        for session in (first, later)
    ]
    assert values == [[230, 220, 212], [205, 200]]


def test_fhir_has_it_with_its_loinc_code(world):
    session = walk(world.patient, "positive", [HIT, HIT])
    for test, value in (("6mwt", 231), ("berg", 41)):
        Assessment.everywhere.create(
            clinic=world.clinic, patient=world.patient, test=test, value=value, at=NOW
        )
    bundle = make_bundle(world.people[Role.PT], session, Pseudonyms())
    found = {
        code["code"]: entry["resource"]
        for entry in bundle["entry"]
        for code in entry["resource"].get("code", {}).get("coding", ())
    }
    assert found["64098-7"]["valueQuantity"] == {
        "value": 231,
        "unit": "m",
        "system": "http://unitsofmeasure.org",
        "code": "m",
    }
    assert [code["system"] for code in found["berg"]["code"]["coding"]] == ["urn:garry:test"]


FORM = "Bends | 0 | 2\nAngle | 0.0 | 150.0 | 20 | 120\nTone | none, some, much\nShoes | text"
FILLED = {"item_0": "2", "item_1": "30,5", "item_2": "1", "item_3": "trainers"}


@pytest.fixture
def form(world):
    ClinicTest.everywhere.all().delete()
    return ClinicTest.everywhere.create(
        clinic=world.clinic, code="knee", name="Knee of ours", items=FORM, higher_is_better=False
    )


def test_a_form_of_the_clinics_own_is_filled_and_summed_up(world, form):
    page = take(world, "own-knee", **FILLED)
    assert "Knee of ours" in page.content.decode()
    (row,) = Assessment.everywhere.all()
    assert (row.value, row.remarks) == (33.5, "Shoes: trainers")
    assert row.answers == [["Bends", 2.0], ["Angle", 30.5], ["Tone", 1.0]]
    take(world, "own-knee", **FILLED | {"item_1": "25"})
    course = load_courses(world.people[Role.PT], world.patient)[-1]
    assert (course.now, course.verdict) == ("28.0 / 154", 1)  # less is better


@pytest.mark.parametrize(
    ("answers", "cure"),
    [
        ({"item_0": "3"}, "Give 0 to 2."),
        ({"item_0": "1.5"}, "Enter a whole number"),
        ({"item_1": ""}, "required"),
        ({"item_2": "3"}, "valid choice"),
        ({"item_1": "130"}, "Outside the usual 20.0 to 120.0. Check it; if it is right, say why"),
    ],
)
def test_an_answer_that_cannot_be_or_is_unusual_is_asked_back(world, form, answers, cure):
    page = take(world, "own-knee", **FILLED | answers)
    assert cure in page.content.decode()
    assert not Assessment.everywhere.exists()


def test_an_unusual_answer_is_taken_with_its_reason(world, form):
    take(world, "own-knee", **FILLED | {"item_1": "130", "item_3": "", "why": "no cast today"})
    (row,) = Assessment.everywhere.all()
    assert (row.value, row.remarks) == (133.0, "no cast today")


def test_a_form_with_results_stays_as_it_is_and_is_not_deleted(world, form):
    client = client_of(world)
    change = reverse("admin:rehab_clinictest_change", args=[form.pk])
    items = FORM.replace("\n", "\r\n")  # as browsers send it
    fields = {"code": "knee", "name": "Knee of ours", "items": f"{items}\r\nMore | 0 | 9"}
    assert client.get(change.replace("change", "delete")).status_code == 200
    assert client.post(change, fields | {"is_offered": "on"}).status_code == 302
    take(world, "own-knee", **FILLED | {"item_4": "1"})
    assert "Make a new one" in client.post(change, fields | {"items": items}).content.decode()
    assert client.get(change.replace("change", "delete")).status_code == 403
    assert client.post(change, fields).status_code == 302  # it is not offered any more
    form.refresh_from_db()
    assert (form.items.count("\n"), form.is_offered) == (4, False)
    names = [one.test.slug for one in load_courses(world.people[Role.PT], world.patient)]
    assert names[-1] == "own-knee"  # with its result
    Assessment.everywhere.all().delete()
    names = [one.test.slug for one in load_courses(world.people[Role.PT], world.patient)]
    assert "own-knee" not in names


def test_a_form_that_cannot_be_read_is_refused_with_the_line(world):
    fields = {"code": "tone", "name": "Tone", "items": "Tone | none"}
    page = client_of(world).post(reverse("admin:rehab_clinictest_add"), fields)
    assert "“Tone | none” cannot be read" in page.content.decode()


def test_erasing_a_patient_takes_the_remarks_of_forms(world, form):
    take(world, "own-knee", **FILLED)
    erase(world.patient, next(iter(ErasureReason)), world.people[Role.LEAD], NOW)
    (row,) = Assessment.everywhere.all()
    assert (row.value, row.remarks) == (33.5, "")


def test_nobody_takes_another_clinics_form(world, form):
    other = build_world("other")
    assert take(other, "own-knee", **FILLED).status_code == 404
