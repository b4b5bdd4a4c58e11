"""What two people do with one patient at the same moment: nobody's act undoes another's."""

from __future__ import annotations

import threading
from collections.abc import Callable
from typing import Any

import pytest
from django.db import connections
from django.test import Client
from django.urls import reverse

from rehab.boards.cache import clear_cache
from rehab.boards.cache_invalidation import BoardChange
from rehab.boards.models import Leaderboard
from rehab.patients.erasure import erase
from rehab.people.consent.models import Consent, Purpose
from rehab.people.consent.services import (
    active_consents,
    current_text,
    record_boards_consent,
    record_consent,
    withdraw_consent,
)
from rehab.people.models import BoardsConsent, ErasureReason, Patient
from rehab.people.sign_in.tokens import ApiToken
from rehab.sessions.setup.default_protocols import install_defaults
from rehab.training.measures import InvalidSetting
from tests.support.boards import figures_of
from tests.support.world import NOW, World, build_world

pytestmark = [pytest.mark.django_db, pytest.mark.postgres]
SCREEN = {"screen_side": "left", "screen_text": "large"}
DETAILS = {"nickname": "Rosa", "code": "R-1", "paretic_side": "left", "body_mass_kg": 70}


def save_screen(world: World) -> Any:
    return world.pt.post(reverse("screen", args=[world.patient.pk]), SCREEN)


def save_details(world: World) -> Any:
    return world.pt.post(reverse("edit-patient", args=[world.patient.pk]), DETAILS)


def patch(world: World) -> Any:
    holder: ApiToken = world.rows[ApiToken]
    token = holder.new_token()
    holder.save()
    return Client(headers={"Authorization": f"Bearer {token}"}).patch(
        f"/api/v1/patients/{world.patient.pk}", DETAILS, content_type="application/json"
    )


def between(monkeypatch: pytest.MonkeyPatch, act: Callable[[], Any]) -> None:
    """Let somebody else act once a row was read and found good, before it is stored."""
    find_good, done = Patient.full_clean, list[bool]()

    def stop_there(patient: Patient, *args: Any, **kwargs: Any) -> None:
        find_good(patient, *args, **kwargs)
        if not done:
            done.append(True)
            act()

    monkeypatch.setattr(Patient, "full_clean", stop_there)


@pytest.mark.parametrize(
    ("save", "status"), [(save_screen, 200), (save_details, 200), (patch, 409)]
)
def test_who_is_erased_while_somebody_saves_stays_erased(save, status, world, monkeypatch):
    patient = Patient.everywhere.get(pk=world.patient.pk)
    between(monkeypatch, lambda: erase(patient, ErasureReason.ASKED, None, NOW))
    answer = save(world)
    assert (answer.status_code, b"This person is erased" in answer.content) == (status, True)
    stored = Patient.everywhere.get(pk=patient.pk)
    assert (stored.nickname, stored.code) == ("Erased", stored.pseudonym)
    assert (stored.erased_at, stored.body_mass_kg, stored.alias) == (NOW, None, None)
    assert stored.screen_side == "right"


@pytest.mark.parametrize("save", [save_screen, save_details, patch])
def test_who_leaves_the_boards_while_somebody_saves_has_left_them(save, world, monkeypatch):
    leave = reverse("leave-boards", kwargs={"session_id": world.session.pk})
    between(monkeypatch, lambda: world.pt.post(leave))
    assert save(world).status_code in (200, 302)
    stored = Patient.everywhere.get(pk=world.patient.pk)
    assert stored.boards == BoardsConsent.OWN
    assert "boards" not in active_consents(stored)
    assert stored.pk not in figures_of(world.rows[Leaderboard])


def test_whoever_read_the_patient_before_withdraws_and_erases_what_is_there_now(world):
    early, erasing = (Patient.everywhere.get(pk=world.patient.pk) for _ in range(2))
    early.boards = erasing.boards = BoardsConsent.OWN  # read before the patient joined
    withdraw_consent(early, Purpose.BOARDS, None, NOW)
    assert Patient.everywhere.get(pk=early.pk).boards == BoardsConsent.OWN
    record_boards_consent(world.patient, BoardsConsent.ACROSS, None, NOW)
    erase(erasing, ErasureReason.ASKED, None, NOW)
    stored = Patient.everywhere.get(pk=early.pk)
    assert (stored.boards, stored.alias) == (BoardsConsent.OWN, None)
    assert stored.pk not in figures_of(world.rows[Leaderboard])


def test_nobody_agrees_joins_or_walks_for_a_person_who_was_just_erased(world):
    stale = [Patient.everywhere.get(pk=world.patient.pk) for _ in range(3)]
    erase(world.patient, ErasureReason.ASKED, None, NOW)
    agreed = Consent.everywhere.count()
    record_consent(stale[0], Purpose.CARE, None, NOW)
    record_boards_consent(stale[1], BoardsConsent.CLINIC, None, NOW)
    assert Consent.everywhere.count() == agreed
    assert Patient.everywhere.get(pk=world.patient.pk).boards == BoardsConsent.OWN
    with pytest.raises(InvalidSetting, match="has ended"):
        world.begin_session(stale[2])


def test_who_no_longer_agrees_stands_on_no_board_whatever_the_row_says(world):
    board = world.rows[Leaderboard]
    Consent.everywhere.filter(patient=world.patient).update(withdrawn_at=NOW)
    assert world.patient.pk not in figures_of(board)
    Patient.everywhere.filter(pk=world.patient.pk).update(simulated=True)  # agrees to everything
    clear_cache()
    assert world.patient.pk in figures_of(board)


def test_a_screen_setting_costs_boards_nothing(world):
    before = BoardChange.everywhere.count()
    patient = Patient.everywhere.get(pk=world.patient.pk)
    patient.screen_still = True
    patient.save_fields("screen_still")
    assert BoardChange.everywhere.count() == before
    patient.blinded = False
    patient.save_fields("blinded")
    assert BoardChange.everywhere.count() == before + 1


# --- at the same time ---------------------------------------------------------------------------


@pytest.fixture
def busy(transactional_db: None) -> World:
    """A world whose rows other threads see."""
    install_defaults()
    return build_world("amber")


def at_once(*acts: Callable[[], Any]) -> list[Any]:
    """Act in a thread each, all at the same moment."""
    start, answers = threading.Barrier(len(acts)), [None] * len(acts)

    def run(number: int, act: Callable[[], Any]) -> None:
        try:
            start.wait(10)
            answers[number] = act()
        finally:
            connections.close_all()

    threads = [threading.Thread(target=run, args=one) for one in enumerate(acts)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    return answers


def test_the_admin_holds_the_patient_whom_it_changes(busy, monkeypatch):
    """The erasing comes while the form is looked at, and is done after it or before it."""
    patient, lead = busy.patient, busy.lead
    other = Patient.everywhere.get(pk=patient.pk)
    found, threads = Patient.full_clean, list[threading.Thread]()

    def run() -> None:
        erase(other, ErasureReason.ASKED, None, NOW)
        connections.close_all()

    def erase_beside(row: Patient, *args: Any, **kwargs: Any) -> None:
        found(row, *args, **kwargs)
        if not threads:
            act = threading.Thread(target=run)
            threads.append(act)
            act.start()
            act.join(0.3)  # it has to wait

    monkeypatch.setattr(Patient, "full_clean", erase_beside)
    given = {"code": "R-1", "nickname": "Rosa", "paretic_side": "left", "language": "en"}
    change = reverse("admin:rehab_patient_change", args=[patient.pk])
    assert lead.post(change, given).status_code == 302
    threads[0].join()
    stored = Patient.everywhere.get(pk=patient.pk)
    assert (stored.nickname, stored.erased_at) == ("Erased", NOW)


def test_a_consent_that_is_tapped_twice_is_noted_once(busy):
    current_text(busy.clinic)
    url = reverse("consent", args=[busy.patient.pk])
    browsers = [busy.pt for _ in range(2)]
    for _ in range(5):
        withdraw_consent(busy.patient, Purpose.CARE, None, NOW)
        taps = [
            lambda one=one: one.post(url, {"purpose": "care", "answer": "yes"}).status_code
            for one in browsers
        ]
        assert at_once(*taps) == [302, 302]
        assert Consent.everywhere.filter(purpose="care", withdrawn_at=None).count() == 1
