"""Corrections: who walked, what counts, a note. Audited, and everything that follows follows."""

from __future__ import annotations

import html
import re
from typing import Any

import pytest
from django.core.exceptions import ValidationError
from django.db import IntegrityError, transaction
from django.urls import reverse

from rehab.boards.models import Leaderboard
from rehab.patients.erasure import erase
from rehab.people.consent.models import Purpose
from rehab.people.consent.services import record_consent
from rehab.people.models import ErasureReason, Patient
from rehab.people.roles import Role
from rehab.sessions import corrections
from rehab.sessions.corrections import (
    CorrectedField,
    SessionCorrection,
    correct_session,
    current_note,
)
from rehab.sessions.log import SessionEvent, SessionMetric, Step
from rehab.sessions.models import TrainingSession
from rehab.sessions.reports.day.week import week_summary
from rehab.sessions.reports.patient_summary import describe_take_home
from rehab.sessions.reports.trend import load_trend
from tests.support.boards import all_rows, figures_of, rows_computed_anew
from tests.support.walks import make_patient, strides, walk
from tests.support.world import NOW, World, agreeing, build_world, client_of

pytestmark = [pytest.mark.django_db, pytest.mark.postgres]


def patient_of(world: World, name: str, **fields) -> Patient:
    patient = make_patient(world.clinic, name, code=f"K-{ord(name[0])}", **fields)
    return agreeing(patient)


@pytest.fixture
def rosa(world: World) -> Patient:
    return patient_of(world, "Rosa", boards="clinic")


@pytest.fixture
def omar(world: World) -> Patient:
    return patient_of(world, "Omar", boards="clinic")


def opened(world: World, session: TrainingSession, role: Role = Role.PT) -> dict[str, str]:
    """Open the form, and give what its page sends where nobody touches a field."""
    page = client_of(world, role).get(reverse("correct", args=[session.pk])).content.decode()
    return sent_by(page)


def sent_by(page: str) -> dict[str, str]:
    """Return what a page with the form sends."""
    form = re.search(r'<form method="post" class="fields card">.*?</form>', page, re.DOTALL)
    found: dict[str, str] = {}
    for tag in re.findall(r"<input[^>]*>", form[0] if form else ""):
        attributes = dict(re.findall(r'([\w-]+)="([^"]*)"', tag))
        if attributes.get("type") == "hidden" or " checked" in tag:
            found[attributes["name"]] = html.unescape(attributes.get("value", ""))
    for name, words in re.findall(
        r'<textarea name="(\w+)".*?>\s*(.*?)</textarea>', page, re.DOTALL
    ):
        found[name] = html.unescape(words)
    chosen = re.search(r'<select name="patient".*?<option value="(\d+)" selected', page, re.DOTALL)
    return found | ({"patient": chosen[1]} if chosen else {})


def correct(world: World, session: TrainingSession, role: Role = Role.PT, **changes):
    """Send the form as its page does, with these fields altered."""
    session.refresh_from_db()
    url = reverse("correct", args=[session.pk])
    sent = opened(world, session, role) | {"reason": "Read off the sheet."} | changes
    return client_of(world, role).post(url, sent)


def log_of(session: TrainingSession) -> list[object]:
    """Return everything that was recorded of a session."""
    return [
        list(model.everywhere.filter(session=session).order_by("pk").values())
        for model in (Step, SessionEvent, SessionMetric)
    ]


def board_of(world: World) -> Leaderboard:
    board: Leaderboard = world.rows[Leaderboard]
    Leaderboard.everywhere.filter(pk=board.pk).update(types="all", metric="hit_rate")
    board.refresh_from_db()
    return board


def agrees_with_another_server() -> None:
    """Fail where the cached rows of boards differ from rows computed anew."""
    assert all_rows() == rows_computed_anew()


def test_a_session_goes_to_whoever_walked_it(world, rosa, omar):
    board = board_of(world)
    session = walk(rosa, "positive", strides(9, 1))
    walk(rosa, "positive", strides(1, 1), days_ago=1)
    log = log_of(session)
    assert figures_of(board)[rosa.pk] == 90
    assert correct(world, session, patient=omar.pk).status_code == 302
    session.refresh_from_db()
    assert session.patient == omar
    assert {rosa.pk: 50, omar.pk: 90}.items() <= figures_of(board).items()
    agrees_with_another_server()
    assert log_of(session) == log
    row = SessionCorrection.everywhere.get(session=session)
    assert (row.field, row.old, row.new) == (CorrectedField.PATIENT, rosa.pseudonym, omar.pseudonym)
    assert (row.by, row.reason) == (world.people[Role.PT], "Read off the sheet.")


def test_who_loses_the_only_session_leaves_the_board(world, rosa, omar):
    board = board_of(world)
    session = walk(rosa, "positive", strides(9, 1))
    correct(world, session, patient=omar.pk)
    assert rosa.pk not in figures_of(board)
    agrees_with_another_server()


def test_what_is_left_out_is_in_no_board_trend_week_or_paper_and_comes_back(world, rosa):
    board = board_of(world)
    pt = world.people[Role.PT]
    now = NOW
    bad = walk(rosa, "positive", strides(10, 0))
    good = walk(rosa, "positive", strides(5, 5), days_ago=1)
    mine = TrainingSession.objects.visible_to(pt).filter(patient=rosa)

    def figures() -> tuple[Any, ...]:
        return (
            figures_of(board).get(rosa.pk),
            [point.session.pk for point in load_trend(pt, mine)],
            week_summary(pt, world.clinic, now).total.sessions,
            describe_take_home(mine, now)["count"],
        )

    before = figures()
    assert before[:2] == (100, [good.pk, bad.pk])
    log = log_of(bad)
    correct(world, bad, counts="no")
    assert figures() == (50, [good.pk], before[2] - 1, before[3] - 1)
    agrees_with_another_server()
    page = client_of(world).get(reverse("history", args=[rosa.pk])).content.decode()
    assert "1 session left out of these figures by a correction." in page
    own = client_of(world).get(reverse("scores", args=[good.pk])).content.decode()
    assert "100\N{NO-BREAK SPACE}%" not in own
    assert "not computed" in client_of(world).get(f"/sessions/{bad.pk}/details/").content.decode()
    correct(world, bad, counts="yes")
    assert figures() == before
    assert log_of(bad) == log
    told = SessionCorrection.everywhere.filter(session=bad).values_list("old", "new")
    assert list(told.order_by("pk")) == [("yes", "no"), ("no", "yes")]


def test_the_board_follows_in_the_same_transaction(world, rosa, omar, monkeypatch):
    board = board_of(world)
    session = walk(rosa, "positive", strides(9, 1))
    before = figures_of(board)

    class Broken(RuntimeError):
        pass

    def fail(self, *args, **kwargs):
        raise Broken

    monkeypatch.setattr(corrections.SessionCorrection, "save", fail)
    changes = {CorrectedField.PATIENT: omar.pseudonym}
    with pytest.raises(Broken):
        correct_session(session, changes, "why", world.people[Role.PT], NOW)
    session.refresh_from_db()
    assert session.patient == rosa
    assert figures_of(board) == before


def test_a_note_stands_with_the_session_and_the_last_one_holds(world, rosa):
    session = walk(rosa, "positive", strides(3, 1))
    correct(world, session, note="Walked with a cane.")
    correct(world, session, note="Walked with a cane from minute two.")
    page = client_of(world).get(reverse("session", args=[session.pk])).content.decode()
    assert re.search(r"<h2>Note</h2>\s*<p>Walked with a cane from minute two.</p>", page)
    assert "Walked with a cane. → Walked with a cane from minute two." in " ".join(page.split())
    assert SessionCorrection.everywhere.filter(session=session).count() == 2


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({}, "Nothing is altered"),
        ({"counts": "no", "reason": " "}, "This field is required"),
        ({"counts": "no", "reason": "It was rosa who slipped."}, "Leave out “Rosa”"),
        ({"note": "See k-82."}, "Leave out “K-82”"),
        ({"counts": "maybe"}, "Select a valid choice"),
        ({"patient": "999999"}, "Select a valid choice"),
    ],
)
def test_a_correction_that_says_too_little_or_too_much_is_refused(world, rosa, changes, words):
    session = walk(rosa, "positive", strides(3, 1))
    page = correct(world, session, **changes)
    assert page.status_code == 200
    assert words in page.content.decode()
    assert not SessionCorrection.everywhere.filter(session=session).exists()


def test_an_older_form_undoes_nothing_and_shows_what_was_altered_meanwhile(world, rosa, omar):
    session = walk(rosa, "positive", strides(3, 1))
    url, client = reverse("correct", args=[session.pk]), client_of(world)
    older = opened(world, session)
    correct(world, session, Role.LEAD, counts="no", patient=str(omar.pk))
    page = client.post(url, older | {"note": "Walked with\r\na cane.", "reason": "Told later."})
    said = html.unescape(page.content.decode())
    lead = world.people[Role.LEAD]
    assert f"Who walked: Omar ({lead}) · Counts: left out ({lead})" in said
    session.refresh_from_db()
    assert (session.patient, session.excluded) == (omar, True)
    assert SessionCorrection.everywhere.filter(session=session).count() == 2
    again = sent_by(page.content.decode())
    assert (again["patient"], again["counts"]) == (str(omar.pk), "no")
    assert again["note"] == "Walked with\r\na cane."
    assert client.post(url, again).status_code == 302
    session.refresh_from_db()
    assert (session.patient, session.excluded) == (omar, True)
    newest = SessionCorrection.everywhere.filter(session=session).order_by("-pk")[0]
    assert (newest.field, newest.new) == (CorrectedField.NOTE, "Walked with\na cane.")
    assert newest.reason == "Told later."
    still = client.post(url, opened(world, session) | {"reason": "Nothing."})
    assert "Nothing is altered" in still.content.decode()


def test_a_form_that_does_not_say_what_it_showed_alters_nothing(world, rosa):
    session = walk(rosa, "positive", strides(3, 1))
    sent = {"patient": rosa.pk, "counts": "no", "note": "", "reason": "The cable was loose."}
    page = client_of(world).post(reverse("correct", args=[session.pk]), sent)
    assert "in the meantime" in page.content.decode()
    session.refresh_from_db()
    assert not session.excluded


def test_another_clinics_patient_cannot_have_walked_here(world, rosa):
    birch = build_world("birch")
    session = walk(rosa, "positive", strides(3, 1))
    page = correct(world, session, patient=birch.patient.pk)
    assert "Select a valid choice" in page.content.decode()
    url = reverse("correct", args=[birch.session.pk])
    assert client_of(world).get(url).status_code == 404


def test_a_session_that_still_runs_is_ended_first(world, rosa):
    session = walk(rosa, "positive", strides(3, 1), end=None)
    answer = correct(world, session, counts="no")
    assert answer.headers["Location"] == reverse("session", args=[session.pk])
    session.refresh_from_db()
    assert not session.excluded


def test_a_researcher_reads_corrections_by_pseudonym_and_makes_none(world, rosa, omar):
    for patient in (rosa, omar):
        record_consent(patient, Purpose.RESEARCH, None, NOW)
    session = walk(rosa, "positive", strides(3, 1))
    correct(world, session, patient=omar.pk)
    assert correct(world, session, Role.RESEARCHER, counts="no").status_code == 403
    for url in (
        reverse("session", args=[session.pk]),
        reverse("admin:rehab_trainingsession_change", args=[session.pk]),
        reverse("admin:rehab_sessioncorrection_changelist"),
    ):
        page = client_of(world, Role.RESEARCHER).get(url).content.decode()
        assert rosa.pseudonym in page
        assert omar.pseudonym in page
        assert "Rosa" not in page
        assert "Omar" not in page
        assert reverse("correct", args=[session.pk]) not in page


def test_a_therapist_finds_them_in_the_admin_and_edits_none(world, rosa, omar):
    session = walk(rosa, "positive", strides(3, 1))
    correct(world, session, patient=omar.pk)
    client = client_of(world)
    page = client.get(reverse("admin:rehab_trainingsession_change", args=[session.pk]))
    assert "Rosa → Omar" in page.content.decode()
    assert reverse("correct", args=[session.pk]) in page.content.decode()
    row = SessionCorrection.everywhere.get(session=session)
    for act in ("change", "delete"):
        url = reverse(f"admin:rehab_sessioncorrection_{act}", args=[row.pk])
        assert client.post(url, {"post": "yes", "reason": "x"}).status_code == 403
    assert client.get(reverse("admin:rehab_sessioncorrection_add")).status_code == 403


def test_rows_are_only_ever_added(world):
    row = world.rows[SessionCorrection]
    row.reason = "another"
    for attempt in (row.save, row.delete):
        with pytest.raises(IntegrityError, match="append-only"), transaction.atomic():
            attempt()


def test_the_api_says_what_is_left_out(world, rosa):
    session = walk(rosa, "positive", strides(3, 1))
    correct(world, session, counts="no")
    told = client_of(world).get(f"/api/v1/sessions/{session.pk}").json()
    assert told["excluded"] is True


def test_nobody_who_is_erased_is_offered_or_taken_as_who_walked(world, rosa, omar):
    erase(rosa, ErasureReason.ASKED, None, NOW)
    pt, url = client_of(world), reverse("correct", args=[world.session.pk])
    page = pt.get(url).content.decode()
    assert f'value="{omar.pk}"' in page
    assert f'value="{rosa.pk}"' not in page
    with pytest.raises(ValidationError, match="no such patient"):
        correct_session(
            world.session,
            {CorrectedField.PATIENT: rosa.pseudonym},
            "Why.",
            world.people[Role.PT],
            NOW,
        )
    erase(world.patient, ErasureReason.ASKED, None, NOW)  # who did walk stays chosen
    assert f'value="{world.patient.pk}" selected' in pt.get(url).content.decode()
    group = pt.get(reverse("admin:rehab_leaderboard_add")).content.decode()
    assert f'name="group" value="{omar.pk}"' in group
    assert f'name="group" value="{rosa.pk}"' not in group


def test_notes_are_typed_while_a_session_runs_and_add_up(world):
    session = world.session
    TrainingSession.everywhere.filter(pk=session.pk).update(state="running")
    client, url = client_of(world), f"/sessions/{session.pk}/note/"
    before = current_note(session, world.people[Role.PT])
    assert client.post(url, {"note": "Uses a cane.\r\nTired."}).status_code == 200
    assert client.post(url, {"note": "  "}).status_code == 400
    assert client.post(url, {"note": "x" * 501}).status_code == 400
    note = current_note(session, world.people[Role.PT])
    assert note.startswith(f"{before}\n")
    assert note.endswith(" Uses a cane.\nTired.")
    assert client_of(world, Role.RESEARCHER).post(url, {"note": "x"}).status_code == 403
