"""Who changed what is kept, read by those who may see the row, and without values once erased."""

from __future__ import annotations

import pytest
from django.db.models import ProtectedError
from django.test import Client
from django.urls import reverse

from rehab.boards.models import Leaderboard
from rehab.gestures.models import GestureStep
from rehab.models import TRACKED
from rehab.people.audit import history
from rehab.people.audit.history import HistoryEntry
from rehab.people.audit.row_history import describe_actor
from rehab.people.models import Patient, User
from rehab.people.roles import Role
from rehab.people.sign_in.tokens import ApiToken
from rehab.stations.models import Device
from rehab.stations.pins import set_pin
from tests.support.marks import mark
from tests.support.world import build_world, client_of

pytestmark = pytest.mark.django_db


def last_of(row) -> HistoryEntry:
    return HistoryEntry.everywhere.filter(model_name=type(row).__name__, object_id=row.pk).first()


def test_an_account_that_has_changed_something_is_never_deleted(world):
    """The digest of what it did names it: accounts are switched off instead."""
    newcomer = User.everywhere.create_user("new", role=Role.PT, clinic=world.clinic)
    HistoryEntry.everywhere.create(
        clinic=world.clinic, model_name="Patient", object_id=1, kind="added", by=newcomer
    )
    with pytest.raises(ProtectedError):
        newcomer.delete()


@pytest.mark.parametrize("model", TRACKED, ids=lambda model: model.__name__)
def test_every_row_of_people_and_settings_has_its_making_on_record(model, world):
    entry = last_of(world.rows[model])
    assert entry.kind == "added"
    assert entry.clinic == world.clinic


def test_a_change_tells_the_field_before_and_after_and_who_did_it(world):
    url = reverse("edit-patient", kwargs={"patient_id": world.patient.pk})
    given = {"nickname": "Rosa", "code": "R1", "paretic_side": "right"}
    assert world.pt.post(url, given).status_code == 302
    entry = last_of(world.patient)
    assert entry.by == world.people[Role.PT]
    assert entry.changes == {
        "nickname": [mark("amber", Patient), "Rosa"],
        "code": [mark("amber", Patient), "R1"],
        "paretic_side": ["left", "right"],
    }


def test_a_program_is_named_beside_its_person(world):
    row = ApiToken(clinic=world.clinic, user=world.people[Role.LEAD], name="nightly", role=Role.PT)
    row.may_steer = True
    token = row.new_token()
    row.save()
    answer = Client(headers={"Authorization": f"Bearer {token}"}).patch(
        f"/api/v1/patients/{world.patient.pk}", {"nickname": "Rosa"}, "application/json"
    )
    assert answer.status_code == 200
    entry = last_of(world.patient)
    assert (entry.by, entry.through) == (world.people[Role.LEAD], "nightly")


def test_a_change_without_a_person_is_the_servers():
    assert describe_actor(HistoryEntry()) == "the server"
    assert describe_actor(HistoryEntry(by=User(username="ana"), through="lab")) == "ana · lab"


def test_a_save_that_changes_nothing_is_no_change(world):
    before = HistoryEntry.everywhere.count()
    world.patient.save()
    client_of(world, Role.LEAD)  # signing in writes the time into the account
    assert HistoryEntry.everywhere.count() == before


def test_passwords_pins_and_tokens_are_never_kept(world):
    user = world.people[Role.PT]
    user.set_password("correct horse battery")
    user.save()
    station = world.device.station
    set_pin(station, "4711")
    station.save()
    assert last_of(station).changes["pin_hash"] == ["", history.MASK]
    assert last_of(user).changes["password"] == [history.MASK, history.MASK]
    world.device.new_token()
    world.device.save()
    kept = str(list(HistoryEntry.everywhere.values_list("changes")))
    assert world.device.token_hash not in kept
    assert user.password not in kept


def test_revoking_a_token_in_the_admin_is_on_record(world):
    chosen = {"action": "revoke_tokens", "_selected_action": [world.device.pk]}
    world.lead.post(reverse("admin:rehab_device_changelist"), chosen)
    entry = last_of(Device.everywhere.get(pk=world.device.pk))
    assert entry.by == world.people[Role.LEAD]
    assert list(entry.changes) == ["revoked_at"]


def test_the_group_of_a_board_is_on_record(world):
    board = world.rows[Leaderboard]
    board.group.add(world.patient)
    assert last_of(board).changes == {"group": [None, [world.patient.pk]]}
    board.group.clear()
    assert last_of(board).changes == {"group": [[world.patient.pk], None]}


def test_a_rows_page_tells_its_changes_and_those_of_its_parts(world):
    step = world.rows[GestureStep]
    step.hold_s = 2.5
    step.save()
    GestureStep.everywhere.create(gesture=step.gesture, position=2, hold_s=1.0).delete()
    url = reverse("admin:rehab_composedgesture_history", args=[step.gesture_id])
    words = world.lead.get(url).content.decode()
    assert "1.0 → 2.5" in words
    assert "Deleted: step" in words


def test_a_choice_and_a_row_are_told_in_words(world):
    world.device.kind = "robot"
    world.device.save()
    url = reverse("admin:rehab_device_history", args=[world.device.pk])
    assert "Sensor → Robot" in world.lead.get(url).content.decode()


def test_each_role_reads_the_changes_of_what_it_may_read_and_of_its_clinic(world):
    birch = build_world("birch")

    def nouns(user: User) -> set[str]:
        entries = HistoryEntry.objects.visible_to(user)
        assert not entries.filter(clinic=birch.clinic).exists()
        return set(entries.values_list("model_name", flat=True))

    assert {"Patient", "User", "Clinic"} <= nouns(world.people[Role.LEAD])
    assert "User" not in nouns(world.people[Role.PT])
    researcher = nouns(world.people[Role.RESEARCHER])
    assert "Protocol" in researcher
    assert not {"Patient", "User", "Device"} & researcher
    host = User.everywhere.create_user("host", role=Role.HOST)
    hosts = HistoryEntry.objects.visible_to(host).values_list("model_name", flat=True)
    assert set(hosts) <= {"Clinic", "User", "MeasureDefinition", "Protocol", "ProtocolPhase"}


def test_erased_values_are_gone_but_not_who_and_when(world):
    history.erase_values("Patient", world.patient.pk)
    entry = last_of(world.patient)
    assert entry.changes["nickname"] is None
    url = reverse("admin:rehab_patient_history", args=[world.patient.pk])
    assert "erased" in world.lead.get(url).content.decode()


def test_an_accounts_page_tells_which_role_it_had(world):
    pt, lead = world.people[Role.PT], world.lead
    given = {"username": pt.username, "role": "lead", "is_active": "on"}
    assert lead.post(reverse("admin:rehab_user_change", args=[pt.pk]), given).status_code == 302
    words = lead.get(reverse("admin:rehab_user_history", args=[pt.pk])).content.decode()
    assert "Physical therapist → Clinic lead" in words
    birch = client_of(build_world("birch"), Role.LEAD)
    assert birch.get(reverse("admin:rehab_user_history", args=[pt.pk])).status_code == 404
