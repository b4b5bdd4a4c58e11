"""Nobody hears another clinic's session: every socket, found by itself, tried by everyone."""

from __future__ import annotations

import re
from collections import Counter
from typing import Any

import pytest
from asgiref.sync import sync_to_async
from channels.db import database_sync_to_async

from rehab import routing
from rehab.people.models import User
from rehab.people.roles import Role
from rehab.sessions.live.consumers import device as devices
from rehab.sessions.live.consumers import screens
from rehab.sessions.live.consumers.robot import RobotConsumer
from rehab.sessions.live.consumers.screens import MonitorConsumer, PatientConsumer
from rehab.sessions.live.consumers.source import SourceConsumer
from rehab.sessions.models import TrainingSession
from rehab.stations.models import Device, Station
from tests.support.callers import OWN_PAGE, Caller
from tests.support.identities import find_identities, identifying_texts
from tests.support.tablets import approved
from tests.support.walks import make_session
from tests.support.world import Actor, World, all_actors, build_world, signed_in

# Who gets in, by the words of docs/protocol.md: roles, and kinds of device.
MAY_OPEN: dict[type, set[str]] = {
    SourceConsumer: {"source"},
    RobotConsumer: {"robot"},
    PatientConsumer: {"lead", "pt", "tablet"},
    MonitorConsumer: {"lead", "pt"},
}
NOT_YOURS = {4001, 4004}


class Everyone:
    """Both clinics, an open session in each, and everyone who may try."""

    def __init__(self) -> None:
        self.worlds = build_world("amber"), build_world("birch")
        self.sessions = {world.name: self._open(world) for world in self.worlds}
        self.actors = all_actors(*self.worlds)
        self.tokens = {world.device.pk: world.token for world in self.worlds}
        for world in self.worlds:
            station = world.rows[Station]
            for kind in (Device.Kind.TABLET, Device.Kind.ROBOT):
                device, token = approved(station, kind, kind=kind)
                self.tokens[device.pk] = token
                self.actors.append(Actor(f"{kind} of {world.name}", device, world.name, "device"))
        self.cookies: dict[str, str] = {}
        for actor in self.actors:
            if isinstance(actor.subject, User):
                browser = signed_in(actor.subject)
                self.cookies[actor.label] = browser.cookies["sessionid"].value

    @staticmethod
    def _open(world: World) -> TrainingSession:
        return make_session(
            world.patient, station=world.rows[Station], created_by=world.people[Role.PT]
        )

    def headers(self, actor: Actor) -> list[tuple[bytes, bytes]]:
        """Return what this actor's client sends along."""
        if isinstance(actor.subject, Device):
            return [(b"authorization", f"Bearer {self.tokens[actor.subject.pk]}".encode())]
        cookie = self.cookies.get(actor.label)
        return [(b"cookie", f"sessionid={cookie}".encode())] if cookie else []


@pytest.fixture
async def everyone(live_path: None) -> Everyone:
    return await sync_to_async(Everyone)()


def kind_of(actor: Actor) -> str:
    return actor.subject.kind if isinstance(actor.subject, Device) else actor.role


def address(route: str, session: TrainingSession) -> str:
    """Return a route's address for one session. Fails for a parameter that it does not know."""
    path = re.sub(r"<int:session_id>", str(session.pk), route)
    if "<" in path:
        pytest.fail(f"{route}: tell tests/sessions/live/test_socket_tenancy.py what it stands for")
    return f"/{path}"


async def hears(everyone: Everyone, actor: Actor, path: str, session: TrainingSession) -> Any:
    """Dial in, say what a client says first, and give what comes: messages or the code."""
    caller = await Caller(path, headers=everyone.headers(actor), origin=OWN_PAGE).dial()
    hello = {"type": "hello", "version": 1, "run": "r", "last": 0, "base": "null"}
    if "session" not in path:  # devices speak first, pages are spoken to
        await caller.say(hello | {"session": session.pk})
    while caller.code is None:
        try:
            message = await caller.hear()
        except AssertionError:
            break
        if message["type"] in ("snapshot", "welcome"):
            await caller.overhear()
            break
    code, heard = caller.code, caller.heard
    await caller.hang_up()
    return code, heard


async def find_leaks(everyone: Everyone) -> tuple[list[str], Counter[str]]:
    leaks, opened = [], Counter[str]()
    hidden = {
        actor.label: await sync_to_async(identifying_texts)(actor) for actor in everyone.actors
    }
    for route, consumer in routing.SOCKETS.items():
        assert consumer in MAY_OPEN, f"{route}: say in MAY_OPEN who may open it"
        for world in everyone.worlds:
            session = everyone.sessions[world.name]
            other = next(w for w in everyone.worlds if w is not world)
            for actor in everyone.actors:
                code, heard = await hears(everyone, actor, address(route, session), session)
                told = [m for m in heard if m["type"] != "error"]
                marks = str(told)
                there = any(
                    m.get("session") == session.pk
                    or m.get("about", {}).get("session") == session.pk
                    for m in told
                )
                may = actor.clinic == world.name and kind_of(actor) in MAY_OPEN[consumer]
                if there != may:
                    leaks.append(f"{actor.label}: {route} of {world.name}, {code}")
                elif actor.clinic != other.name and f"zq{other.name}" in marks:
                    leaks.append(f"{actor.label}: {route} shows {other.name}")
                elif not may and not told and code not in NOT_YOURS:
                    leaks.append(f"{actor.label}: {route} closes with {code}")
                leaks += [
                    f"{actor.label}: {route} names {whose}"
                    for whose in find_identities(hidden[actor.label], str(heard))
                ]
                opened[route] += there
    return leaks, opened


@pytest.mark.wide
async def test_no_socket_lets_others_in(everyone, capsys):
    leaks, opened = await find_leaks(everyone)
    with capsys.disabled():
        print(f"\nsockets: {len(opened)} × {len(everyone.actors)} actors × 2 clinics")
    assert leaks == []
    # Each clinic's own people and devices came in: the matrix is not empty.
    assert dict(opened) == {
        route: 2 * len(MAY_OPEN[consumer]) for route, consumer in routing.SOCKETS.items()
    }


@pytest.mark.wide
async def test_a_leak_is_caught(everyone, monkeypatch):
    @database_sync_to_async
    def open_to_all(actor: Any, session_id: int) -> bool:
        return True

    monkeypatch.setattr(screens, "may_open", open_to_all)
    leaks, _ = await find_leaks(everyone)
    route = "ws/session/<int:session_id>/patient/"
    assert f"pt of amber: {route} of birch, None" in leaks
    assert f"tablet of birch: {route} of amber, None" in leaks
    assert not any("researcher" in leak or "stranger" in leak for leak in leaks)


@pytest.mark.long
async def test_a_device_at_another_clinics_station_is_caught(everyone, monkeypatch):
    async def find_open_session(device: Device, session_id: int | None) -> int | None:
        return session_id or everyone.sessions["amber"].pk

    monkeypatch.setattr(devices, "find_open_session", find_open_session)
    leaks, _ = await find_leaks(everyone)
    assert "device of birch: ws/source/ of amber, None" in leaks
    assert "robot of birch: ws/robot/ of amber, None" in leaks
    assert not any("researcher" in leak or "pt" in leak.split()[0] for leak in leaks)


async def test_a_new_socket_must_be_given_its_place(everyone, monkeypatch):
    class NewConsumer(PatientConsumer):
        """Somebody's new idea."""

    monkeypatch.setattr(routing, "SOCKETS", {"ws/new/": NewConsumer})
    with pytest.raises(AssertionError, match="MAY_OPEN"):
        await find_leaks(everyone)
    monkeypatch.setattr(routing, "SOCKETS", {"ws/new/<int:patient_id>/": PatientConsumer})
    with pytest.raises(pytest.fail.Exception, match="stands for"):
        await find_leaks(everyone)


def test_every_address_is_in_the_table():
    patterns = [str(pattern.pattern) for pattern in routing.websocket_urlpatterns]
    assert patterns == [*routing.SOCKETS, ""]
