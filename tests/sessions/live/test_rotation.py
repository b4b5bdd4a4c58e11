"""A source's or robot's token is replaced by itself; a copy of an old one is noticed."""

from __future__ import annotations

from datetime import timedelta
from typing import Any

import pytest
from asgiref.sync import sync_to_async
from django.utils import timezone

from rehab.people.audit.audit_log import Act, AuditEntry
from rehab.people.sign_in.tokens import hash_token
from rehab.sessions.live import auth, runtime
from rehab.sessions.live.consumers import device as device_sockets
from rehab.sessions.live.consumers.device import DeviceSocket
from rehab.stations import tokens
from rehab.stations.models import Device
from rehab.stations.presence import format_device_state
from tests.support.callers import RobotCaller, SourceCaller, open_session, turns

find = sync_to_async(tokens.find_device)


async def row_of(device):
    return await Device.everywhere.aget(pk=device.pk)


@pytest.mark.parametrize("kind", ["source", "robot"])
async def test_the_old_token_dies_when_the_new_one_was_used(place, kind):
    caller = await getattr(place, kind)().dial()
    await caller.hello(rotates=True)
    token = (await caller.hear("token"))["token"]
    now = timezone.now()
    old = place.tokens[kind]
    assert await find(old, now) is not None  # its disk may not have the other one
    await caller.say({"type": "token", "token": token})
    await caller.overhear()
    row = await row_of(place.devices[kind])
    assert row.token_hash == hash_token(token)
    assert row.token_expires_at > now + timedelta(days=89)
    assert await find(token, now) == row
    entry = await AuditEntry.everywhere.aget(act=Act.TOKEN)
    assert (entry.clinic_id, entry.through) == (row.clinic_id, str(row)[:64])
    scope: dict[str, Any] = {"url_route": {"kwargs": {}}}
    unauthorized = await auth.find_unauthorized([(connected_device(row), scope)], now)
    assert not unauthorized  # the socket that stored it stays open
    assert await find(old, now) is None
    assert await AuditEntry.everywhere.filter(act=Act.TOKEN_COPY).acount() == 1
    row = await row_of(row)
    state = await sync_to_async(format_device_state)(row, now)
    assert state.startswith("its old token was used on")


def connected_device(row):
    """Return the device as its socket knows it."""
    (socket,) = runtime.current().devices.at(row.station_id)
    assert isinstance(socket, DeviceSocket)
    return socket.device


async def test_a_token_that_was_stored_and_not_said_back_is_good(place):
    source = await place.source().open(rotates=True)
    token = (await source.hear("token"))["token"]
    await source.hang_up()
    again = await SourceCaller(token).open(rotates=True)
    assert not [m for m in await again.overhear() if m["type"] == "token"]
    assert await find(place.tokens["source"], timezone.now()) is None


@pytest.mark.parametrize("when", ["before it is looked for again", "before it is adopted"])
def test_who_says_a_token_back_and_connects_by_it_at_once_is_let_in(place, monkeypatch, when):
    device, now = place.devices["robot"], timezone.now()
    token = tokens.give_successor(device, now)
    said_back = Device.everywhere.get(pk=device.pk)
    name = "find_by_token" if when == "before it is looked for again" else "adopt_successor"
    do = getattr(tokens, name)

    def do_after_the_other(*given):
        found = do(*given) if name == "find_by_token" else None
        monkeypatch.setattr(tokens, name, do)
        assert tokens.adopt_successor(said_back, token, "", now)
        return found if name == "find_by_token" else do(*given)

    monkeypatch.setattr(tokens, name, do_after_the_other)
    found = tokens.find_device(token, now)
    assert found is not None
    assert (found.pk, found.token_hash) == (device.pk, hash_token(token))
    assert AuditEntry.everywhere.filter(act=Act.TOKEN).count() == 1


async def test_a_token_that_was_not_stored_leaves_the_old_one_good(place):
    for _ in range(2):
        source = await place.source().open(rotates=True)
        token = (await source.hear("token"))["token"]
        await source.hang_up()
    assert await find(token, timezone.now()) is not None


async def test_a_session_that_opens_meanwhile_brings_no_second_token(place, monkeypatch):
    """It would make the first one, which the device stores just then, worth nothing."""
    source = await place.source().dial()
    give = auth.offer_successor

    async def give_slowly(device, now):
        (socket,) = runtime.current().devices.at(place.station.pk)
        monkeypatch.setattr(device_sockets, "offer_successor", give)
        socket.on_session_opened(session.pk)
        await turns()
        return await give(device, now)

    session = await sync_to_async(open_session)(place, at_station=False)
    monkeypatch.setattr(device_sockets, "offer_successor", give_slowly)
    await source.hello(rotates=True)
    token = (await source.hear("token"))["token"]
    await source.overhear()
    assert len([m for m in source.heard if m["type"] == "token"]) == 1
    assert await find(token, timezone.now()) is not None


async def test_who_cannot_store_a_token_keeps_its_own(place):
    source, robot = await place.source().open(), await place.robot().open()
    assert not [m for m in await source.overhear() if m["type"] == "token"]
    assert not [m for m in await robot.overhear() if m["type"] == "token"]


async def test_a_token_that_was_not_given_is_refused(place):
    source = await place.source().open()
    await source.say({"type": "token", "token": "mine"})
    code, error = await source.sent_away()
    assert (code, error["code"]) == (4400, "token")


@pytest.mark.parametrize(("days", "is_due"), [(29, False), (31, True)])
def test_another_one_comes_each_month(days, is_due):
    now = timezone.now()
    device = Device(rotated_at=now - timedelta(days=days))
    assert tokens.is_successor_due(device, now) is is_due
    device.builtin = True
    assert not tokens.is_successor_due(device, now)


async def test_one_that_nobody_used_for_long_has_expired(place):
    device = place.devices["robot"]
    now = timezone.now()
    await Device.everywhere.filter(pk=device.pk).aupdate(token_expires_at=now)
    assert await find(place.tokens["robot"], now) is None
    assert await find(place.tokens["robot"], now - timedelta(seconds=1)) is not None
    row = await row_of(device)
    assert "expired" in await sync_to_async(format_device_state)(row, now)
    token = row.new_token()  # what the admin does
    await row.asave()
    await RobotCaller(token).open()


async def test_who_stole_a_token_and_was_first_shuts_its_owner_out(place):
    """And so is found out: the owner's stops with 4001, and the state says why."""
    thief = await place.source().open(rotates=True)
    await thief.say({"type": "token", "token": (await thief.hear("token"))["token"]})
    await thief.overhear()
    owner = await place.source().dial()
    code, _error = await owner.sent_away()
    assert code == 4001
    assert (await row_of(place.devices["source"])).copy_seen_at is not None
