"""Sessions over the API: the same as those of the pages, told by role, in any order."""

from __future__ import annotations

from datetime import datetime
from typing import Any

import pytest
from django.urls import reverse

from rehab.people.models import Patient
from rehab.people.roles import Role
from rehab.sessions.log import SessionMetric, Step
from rehab.sessions.models import TrainingSession
from rehab.sessions.services import SessionRequest, create_session
from rehab.sessions.setup.protocol_models import Protocol
from rehab.stations.models import Station
from rehab.training.goals import GoalRule
from rehab.training.phases import make_phase
from rehab.training.summary.metrics import METRICS
from tests.support.clock import HERE
from tests.support.programs import Program, program_of
from tests.support.world import World, build_world, client_of

pytestmark = pytest.mark.django_db


@pytest.fixture
def pt(world: World) -> Program:
    return program_of(world, Role.PT)


@pytest.fixture
def rosa(world: World) -> Patient:
    return Patient.everywhere.create(
        clinic=world.clinic, code="7", nickname="Rosa", paretic_side="left"
    )


def walked(patient: Patient, valence: str, score: float | None, day: int) -> TrainingSession:
    """Make a finished session with a score."""
    session = create_session(
        SessionRequest(
            patient=patient,
            valence=valence,
            goal=GoalRule(value=3.0),
            phases=[make_phase("training")],
        )
    )
    session.created_at = session.started_at = datetime(2026, 5, day, 9, 30, tzinfo=HERE.tzinfo)
    session.state, session.active_s = "finished", 61.5
    session.save()
    if score is not None:
        SessionMetric.everywhere.create(session=session, slug="score", value=score)
    return session


# --- reading --------------------------------------------------------------------------------------


def test_a_session_is_told_with_its_figures(world, pt):
    status, told = pt.get(f"/sessions/{world.session.pk}")
    assert status == 200
    assert (told["state"], told["feedback_type"], told["goal"]) == ("finished", "positive", 1.0)
    assert (told["score"], told["unit"], told["trained_side"]) == (6, "m", "left")
    assert told["hit_rate"] == pytest.approx(6 / 9)
    assert told["patient"]["nickname"] == world.patient.nickname
    assert told["imported"] is False


def test_researchers_get_pseudonyms_and_nothing_else_of_a_patient(world):
    program = program_of(world, Role.RESEARCHER)
    nobody = {"id": None, "code": None, "nickname": None, "pseudonym": world.patient.pseudonym}
    assert program.get(f"/sessions/{world.session.pk}")[1]["patient"] == nobody
    TrainingSession.everywhere.update(source="Recording rosamunde.csv")
    assert program.get(f"/sessions/{world.session.pk}")[1]["source"] is None
    researcher = client_of(world, Role.RESEARCHER)
    for page in (
        reverse("session", args=[world.session.pk]),
        reverse("report", args=[world.session.pk]),
        reverse("admin:rehab_trainingsession_change", args=[world.session.pk]),
    ):
        assert b"osamunde" not in researcher.get(page).content
    _, page = program.get("/sessions", pseudonym=world.patient.pseudonym)
    assert [row["id"] for row in page["items"]] == [world.session.pk]
    assert program.get("/sessions", pseudonym="P-NOBODY")[1]["total"] == 0
    assert program.post("/sessions", patient=world.patient.pk)[0] == 403
    assert program.post(f"/sessions/{world.session.pk}/changes", kind="abort")[0] == 403


def test_sessions_are_found_by_patient_type_state_and_date(world, pt, rosa):
    first = walked(rosa, "positive", 5, 1)
    second = walked(rosa, "negative", -5, 2)
    assert pt.get("/sessions", patient=rosa.pk)[1]["total"] == 2
    assert pt.get("/sessions", feedback_type="negative")[1]["items"][0]["id"] == second.pk
    assert pt.get("/sessions", state="running")[1] == {"items": [], "total": 0}
    dates = {"since": "2026-05-01T00:00:00Z", "until": "2026-05-02T00:00:00+00:00"}
    assert [row["id"] for row in pt.get("/sessions", **dates)[1]["items"]] == [first.pk]
    oldest = pt.get("/sessions", patient=rosa.pk, order="oldest")[1]["items"]
    assert [row["id"] for row in oldest] == [first.pk, second.pk]
    assert pt.get("/sessions", since="yesterday")[0] == 422
    assert pt.get("/sessions", since="0001-01-01T00:00:00+14:00")[1]["total"] == 3
    status, problem = pt.get("/sessions", feedback_type="kind")
    assert (status, "positive" in problem["fields"]["feedback_type"]) == (422, True)


def test_the_papers_call_gives_a_users_sessions_in_non_ascending_score_order(world, pt, rosa):
    scores = [("positive", 14), ("explicit", None), ("positive", 1402), ("binary", -3)]
    for day, (valence, score) in enumerate(scores, start=1):
        walked(rosa, valence, score, day)
    simulated = walked(rosa, "positive", 5000, 5)  # which the paper has no word for
    type(simulated).everywhere.filter(pk=simulated.pk).update(simulated=True)
    status, page = pt.get("/users/7/sessions")
    assert status == 200
    assert [row["score"] for row in page["items"]] == [1402, 14, -3, None]
    first = page["items"][0]
    assert first.pop("session_id")
    assert first == {
        "participant_id": "7",
        "year": 2026,
        "month": 5,
        "day": 3,
        "start_time": "09:30:00",
        "duration": 61.5,
        "score": 1402,
        "feedback_type": "positive",
        "threshold": 3.0,
    }
    _, page = pt.get("/users/7/sessions", feedback_type="positive", limit=1)
    assert ([row["score"] for row in page["items"]], page["total"]) == ([1402], 2)


def test_steps_come_by_their_number(world, pt):
    path = f"/sessions/{world.session.pk}/steps"
    _, page = pt.get(path, limit=4)
    assert ([step["number"] for step in page["items"]], page["next_after"]) == ([1, 2, 3, 4], 4)
    _, rest = pt.get(path, after=4)
    assert ([step["number"] for step in rest["items"]], rest["next_after"]) == (
        [5, 6, 7, 8, 9, 10],
        None,
    )
    stored = Step.everywhere.get(session=world.session, number=4)
    step = page["items"][3]
    verdict = ("performance", "hit", "late", "points", "valid", "reasons")
    for name in ("value", "shown", "goal", *verdict):
        assert step[name] == getattr(stored, name)
    assert page["items"][2]["valid"] is False


def test_figures_come_with_their_words(world, pt):
    status, figures = pt.get(f"/sessions/{world.session.pk}/metrics")
    assert status == 200
    stored = dict(SessionMetric.everywhere.values_list("slug", "value"))
    assert {row["slug"]: row["value"] for row in figures} == stored
    assert all(row["label"] == METRICS[row["slug"]].label for row in figures)


def test_boards_are_told_as_they_are_shown(world, pt):
    _, page = pt.get("/boards")
    board = page["items"][0]
    status, shown = pt.get(f"/boards/{board['id']}/rows")
    assert status == 200
    assert shown["rows"] == []  # one patient is no group
    assert "Fewer than 5" in shown["note"]
    status, boards = pt.get(f"/sessions/{world.session.pk}/boards")
    assert status == 200
    assert boards[0]["rows"][0]["you"] is True


# --- creating -------------------------------------------------------------------------------------


def newest() -> Any:
    return TrainingSession.everywhere.order_by("pk").last()


def test_a_session_can_be_like_last_time(world, pt, rosa):
    status, told = pt.post("/sessions", patient=rosa.pk, goal=4.05, protocol=protocol().pk)
    assert status == 201, told
    session = newest()
    assert (told["id"], told["state"], told["goal"]) == (session.pk, "ready", 4.05)
    assert (session.patient, session.created_by) == (rosa, world.people[Role.PT])
    assert session.station is not None


def protocol() -> Protocol:
    return Protocol.everywhere.get(name="Training only", clinic=None)


def test_every_choice_reaches_the_plan(world, pt, rosa):
    place = Station.everywhere.create(clinic=world.clinic, name="Free")
    names = {row["name"]: row["id"] for row in pt.get("/protocols")[1]["items"]}
    assert {row["id"] for row in pt.get("/stations")[1]["items"]} >= {place.pk}
    status, told = pt.post(
        "/sessions",
        patient=rosa.pk,
        feedback_type="negative",
        goal_percent=110,
        wanted_hits=65,
        minutes=12,
        protocol=names["Baseline, training, washout"],
        station=place.pk,
        source="synthetic poor",
        trained_side="right",
    )
    assert status == 201, told
    assert (told["goal"], told["simulated"], told["station"]) == (None, True, "Free")
    session = newest()
    plan = session.to_plan()
    assert (plan.valence.slug, plan.goal.percent_of_baseline, plan.trained_side) == (
        "negative",
        110,
        "right",
    )
    assert (plan.target.hit_rate, plan.target.duration_s) == (0.65, 720)
    assert session.source_args[:3] == ["synthetic", "--profile", "poor"]


@pytest.mark.parametrize(
    ("body", "status", "field", "words"),
    [
        ({"goal": 99}, 409, "goal", "up to 15 W/kg"),
        ({"goal": 3, "goal_percent": 100}, 409, "goal", "either"),
        ({"goal_percent": 10}, 409, "goal_percent", "50"),
        ({"protocol": 10**9}, 409, "protocol", "valid choice"),
        ({"station": 10**9}, 409, "station", "valid choice"),
        ({"source": "recording ../../etc/passwd"}, 409, "source", "valid choice"),
        ({"feedback_type": "kind"}, 422, "feedback_type", "positive"),
        ({"goal": "4"}, 422, "goal", "number"),
        ({"gaol": 4}, 422, "gaol", "not permitted"),
        ({"goal": None}, 422, "goal", "number"),
    ],
)
def test_what_cannot_be_walked_is_refused_in_words(pt, rosa, body, status, field, words):
    before = TrainingSession.everywhere.count()
    answer = pt.post("/sessions", patient=rosa.pk, **body)
    assert answer[0] == status, answer
    assert words in answer[1]["fields"][field]
    assert TrainingSession.everywhere.count() == before


def test_nothing_of_another_clinic_can_be_used(world, pt, rosa):
    birch = build_world("birch")
    assert pt.post("/sessions", patient=birch.patient.pk)[0] == 404
    for name, model in (("station", Station), ("protocol", Protocol)):
        status, problem = pt.post("/sessions", patient=rosa.pk, **{name: birch.rows[model].pk})
        assert (status, list(problem["fields"])) == (409, [name])
    assert pt.post(f"/sessions/{birch.session.pk}/changes", kind="start")[0] == 404


# --- steering -------------------------------------------------------------------------------------


@pytest.mark.django_db(transaction=True)  # the writer has its own connection
def test_a_session_is_started_steered_paused_and_finished(world, pt, rosa):
    _, told = pt.post("/sessions", patient=rosa.pk, goal=4.0, protocol=protocol().pk)
    path = f"/sessions/{told['id']}/changes"
    said = [pt.post(path, kind=kind) for kind in ("start", "pause", "resume")]
    assert [(status, row["state"]) for status, row in said] == [
        (200, "running"),
        (200, "paused"),
        (200, "running"),
    ]
    assert pt.post(path, kind="goal", value=4.2)[1]["goal"] == 4.2
    status, problem = pt.post(path, kind="start")
    assert (status, "it must be ready" in problem["message"]) == (409, True)
    status, problem = pt.post(path, kind="goal", value=99)
    assert (status, "up to 15" in problem["fields"]["value"]) == (409, True)
    assert pt.post(path, kind="goal")[0] == 409
    assert pt.post(path, kind="dance")[0] == 422
    assert pt.post(path, kind="chart_style", value="line")[0] == 200
    assert pt.post(path, kind="words_shown", value=0)[0] == 200
    status, problem = pt.post(path, kind="valence", value="negative")
    assert (status, "No phase with feedback follows" in problem["message"]) == (409, True)
    status, problem = pt.post(path, kind="valence", value=2)
    assert (status, "can be changed to one of" in problem["fields"]["value"]) == (409, True)
    status, problem = pt.post(path, kind="feedback_text", value="Go!")
    assert (status, "start, pause" in problem["fields"]["kind"]) == (422, True)
    status, ended = pt.post(path, kind="finish")
    assert (status, ended["state"]) == (200, "finished")
    session = TrainingSession.everywhere.get(pk=told["id"])
    assert {event.by for event in session.events.all()} == {world.people[Role.PT]}
