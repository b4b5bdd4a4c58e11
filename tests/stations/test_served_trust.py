"""Tablets and phones at a real server: who lets them in, and when their open sockets end."""

from __future__ import annotations

import json
from collections.abc import Iterator
from contextlib import ExitStack
from datetime import UTC, datetime
from typing import Any

import pytest

from tests.support.servers import Server, serve
from tests.support.visitors import HELLO, SOURCE, Visitor, until_closed

pytestmark = pytest.mark.server

CLINIC, HOME = "192.168.7.20", "203.0.113.9"  # addresses
# Therapists who are signed in, an open session each, whose tablet shows it and phone measures it.
SEED = """
import json, os
os.environ["GARRY_TEST_CLOCK"] = "{now}"
from rehab.people.consent.models import Purpose
from rehab.people.consent.services import record_consent
from rehab.people.models import User
from rehab.people.roles import Role
from rehab.studies.blinding import Task, give_mark
from tests.support.studies import running_study
from tests.support.tablets import approved
from tests.support.world import NOW, build_world, signed_in

world = build_world("amber")
study, made = running_study(world), {{}}
for name in {names}:
    who = User.everywhere.create_user(name, role=Role.PT, clinic=world.clinic)
    station = world.add_station(name)
    patient = world.add_patient(name, name)
    session = world.begin_session(patient, station=station)
    cookie = signed_in(who).cookies["sessionid"].value
    _, token = approved(station, name, approver=who)
    worn = {{"kind": "source", "place": "shank", "side": "left"}}
    _, phone = approved(station, name, approver=who, **worn)
    made[name] = {{
        "user": who.pk, "station": station.pk, "patient": patient.pk, "session": session.pk,
        "cookie": cookie, "token": token, "phone": phone,
    }}
give_mark(study, User.everywhere.get(username="assessor"), Task.ASSESSOR, None, NOW)
print(json.dumps(made | {{"clinic": world.clinic.pk, "study": study.pk}}))
"""
NAMES = ["assessor", "treating", "leaves", "changes role", "is marked", "moves"]
ENDS = {
    "leaves": "User.everywhere.filter(pk={user}).update(is_active=False)",
    "changes role": "User.everywhere.filter(pk={user}).update(role='researcher')",
    "is marked": "StudyMark.everywhere.create(study_id={study}, user_id={user}, task='assessor')",
}


@pytest.fixture(scope="module")
def server(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Server]:
    with serve(tmp_path_factory.mktemp("data"), settings={"GARRY_PROXIES": "1"}) as running:
        yield running


@pytest.fixture(scope="module")
def seeded(server: Server) -> dict[str, Any]:
    said = server.run_shell(SEED.format(now=datetime.now(UTC).isoformat(), names=NAMES))
    made: dict[str, Any] = json.loads(said.splitlines()[-1])
    return made


def tablet_of(server: Server, row: dict[str, Any], address: str = CLINIC) -> Visitor:
    return Visitor(server.url, address, {"garry_tablet": row["token"]})


def walk(row: dict[str, Any]) -> str:
    return f"/sessions/{row['session']}/"


def socket(row: dict[str, Any]) -> str:
    return f"/ws/session/{row['session']}/patient/"


def change_rows(server: Server, *statements: str) -> None:
    """Change rows behind the server's back, as another process of it does."""
    lines = ["from rehab.people.models import Clinic, User"]
    lines += ["from rehab.studies.models import StudyMark", *statements]
    server.run_shell("\n".join(lines))


@pytest.mark.essential
def test_a_blinded_assessor_lets_no_browser_of_hers_in(server, seeded):
    row = seeded["assessor"]
    own = Visitor(server.url, CLINIC)  # a private window
    code = own.get("/tablet/").text.split('class="code"')[1].split(">")[1].split("<")[0].strip()
    assert len(code) == 6
    herself = Visitor(server.url, CLINIC, {"sessionid": row["cookie"]})
    form = {"code": code, "station": seeded["treating"]["station"]}
    for compared in ("", "yes"):
        answer = herself.post("/tablets/pair/", **form, compared=compared)
        assert (answer.status, "assessor" in answer.text) == (200, True)
    assert not own.get("/tablet/state/").json()["paired"]
    assert own.get(walk(seeded["treating"])).status == 302
    assert own.watch(socket(seeded["treating"]))[0] == 4001
    treating = Visitor(server.url, CLINIC, {"sessionid": seeded["treating"]["cookie"]})
    treating.post("/tablets/pair/", **form)
    assert treating.post("/tablets/pair/", **form, compared="yes").status == 302
    assert own.get("/tablet/state/").json()["paired"]
    assert own.watch(socket(seeded["treating"]))[0] == 0


def test_open_sockets_of_devices_end_with_their_approvers_account_role_or_mark(server, seeded):
    rows = {name: seeded[name] for name in ENDS}
    ends = [ENDS[name].format(**row, study=seeded["study"]) for name, row in rows.items()]
    with ExitStack() as sockets:
        open_ones = [
            sockets.enter_context(tablet_of(server, row).dial(socket(row))) for row in rows.values()
        ]
        phones = [Visitor(server.url, CLINIC, token=row["phone"]) for row in rows.values()]
        for phone in phones:
            assert phone.watch(SOURCE, HELLO)[0] == 0
            open_ones.append(sockets.enter_context(phone.dial(SOURCE)))
            open_ones[-1].send(HELLO)
        for name, row in rows.items():
            assert tablet_of(server, row).get(walk(row)).status == 200, name
        change_rows(server, *ends)
        assert [until_closed(one) for one in open_ones] == [4001] * 2 * len(ENDS)
    for name, row in rows.items():
        assert tablet_of(server, row).get(walk(row)).status == 302, name
        assert tablet_of(server, row).watch(socket(row))[0] == 4001, name
        program = Visitor(server.url, CLINIC, token=row["token"])
        assert program.watch(socket(row))[0] == 4001, name
    assert {phone.watch(SOURCE, HELLO)[0] for phone in phones} == {4001}


def test_outside_the_clinics_networks_a_tablet_gets_nothing_also_once_they_are_named(
    server, seeded
):
    row = seeded["moves"]
    inside, outside = (tablet_of(server, row, address) for address in (CLINIC, HOME))
    with inside.dial(socket(row)) as stays, outside.dial(socket(row)) as ends:
        named = "update(networks='192.168.7.0/24')"
        change_rows(server, f"Clinic.everywhere.filter(pk={seeded['clinic']}).{named}")
        assert until_closed(ends) == 4001
        assert stays.close_code is None
    assert outside.get(walk(row)).status == 404
    assert outside.get("/tablet/state/").json() == {"paired": True, "go": ""}
    assert outside.watch(socket(row))[0] == 4004
    assert inside.get(walk(row)).status == 200
    assert inside.watch(socket(row))[0] == 0
    agreed = "record_consent(Patient.everywhere.get(pk={patient}), Purpose.REMOTE, None, now())"
    change_rows(
        server,
        "from django.utils.timezone import now",
        "from rehab.people.consent.models import Purpose",
        "from rehab.people.consent.services import record_consent",
        "from rehab.people.models import Patient",
        agreed.format(**row),
    )
    assert outside.get(walk(row)).status == 200
    assert outside.watch(socket(row))[0] == 0
