"""Floods, silence, strange addresses and headers: an error with a cure, and no harm to others."""

from __future__ import annotations

import asyncio

import pytest

from rehab.people import clinic_limits
from rehab.sessions.live.consumers import base
from tests.support.callers import (
    Caller,
    MonitorPage,
    PatientPage,
    RobotCaller,
    SourceCaller,
    a_step,
    numbers,
    sign_in,
)

# --- too much, too little -------------------------------------------------------------------------


@pytest.mark.parametrize("is_new", [False, True], ids=["the same step", "a step each"])
async def test_a_flood_of_frames(place, sourced, bystander, monkeypatch, is_new):
    monkeypatch.setattr(base, "FRAME_BURST", 50.0)
    monkeypatch.setattr(base, "FRAMES_PER_S", 1.0)
    session, source = await sourced(place)
    await source.walk(4.0)
    for number in range(2, 62):
        await source.say({"type": "step"} | a_step(number) if is_new else a_step(1))
    code, error = await source.sent_away()
    assert (code, error["code"]) == (4029, "flood")
    assert "frames a second" in error["message"]
    stored = await numbers(session)
    assert stored == list(range(1, len(stored) + 1))
    assert len(stored) <= (50 if is_new else 1)


async def test_a_flood_of_unacknowledged_steps(place, sourced, bystander, stall):
    session, source = await sourced(place)
    stall.begin()
    await source.say({"type": "steps", "steps": [a_step(n) for n in range(1, 257)]})
    assert await source.overhear() == []
    await source.say(a_step(257))
    code, error = await source.sent_away()
    assert (code, error["code"]) == (4029, "flood")
    assert "256" in error["message"]
    stall.end()
    again = await place.source().open()
    await again.acked(256)
    assert await numbers(session) == list(range(1, 257))


async def test_silence_after_the_connection(place, monkeypatch, bystander):
    monkeypatch.setattr(base.Socket, "first_frame_s", 0.01)
    for caller in (SourceCaller(), place.source(), RobotCaller(), place.robot()):
        await caller.dial()
        code, error = await caller.sent_away()
        assert (code, error["code"]) == (4400, "silent")
        assert "hello" in error["message"]


async def test_hello_ends_the_wait_for_it(place, begun, monkeypatch):
    monkeypatch.setattr(base.Socket, "first_frame_s", 0.2)
    await begun(place)
    source, robot = await place.source().open(), await place.robot().open()
    await asyncio.sleep(0.3)
    await source.walk(4.0)
    await robot.hear("step")


async def test_an_unknown_address(live_path):
    for path in (
        "/",
        "/ws/",
        "/ws/source",
        "/ws/sources/",
        "/ws/session/x/patient/",
        "/ws/session/-1/patient/",
        "/ws/session/" + "9" * 5000 + "/patient/",
        "/ws/session/1/",
        "/ws/source/%00/",
    ):
        caller = await Caller(path).dial()
        code, error = await caller.sent_away()
        assert (code, error["code"]) == (4004, "no_address"), path
        assert "/help/protocol/" in error["message"]


async def test_a_session_that_does_not_exist(place):
    for number in (0, 999_999, 10**30):
        for page in (
            MonitorPage(number, user=place.pt),
            PatientPage(number, token=place.tokens["tablet"]),
        ):
            await page.dial()
            assert (await page.sent_away())[0] == 4004


# --- strange headers and addresses ----------------------------------------------------------------


async def test_a_strange_place_to_go_on_from(place, begun):
    session = await begun(place)
    for after in ("", "x", "-1", "1.5", "%00", "9" * 30, "9" * 5000, "²", "1&after=2"):
        tablet = place.tablet(session, f"?after={after}")
        assert (await tablet.watch())["number"] == 0


async def test_a_strange_origin(place, begun):
    session = await begun(place)
    for origin in ("http://[", "null", "", "//", "http://[::1", "é", "http://a:b@"):
        page = MonitorPage(session.pk, user=place.pt, origin=origin)
        await page.dial()
        assert (await page.sent_away())[0] == 4001, origin


async def test_strange_cookies_beside_ours(place, begun):
    session = await begun(place)
    ours = f"sessionid={sign_in(place.pt)}".encode()
    for cookie in (b"a/b=1; ", b"=; ", b"\xff=\xff; ", b'"; ', b"a[b]=1; "):
        await MonitorPage(session.pk, headers=[(b"cookie", cookie + ours)]).watch()


async def test_a_strange_authorization(place, begun):
    session = await begun(place)
    for kind in (b"Basic eDp5", b"Bearer", b"Bearer ", b"", b"\xff\xff"):
        page = PatientPage(session.pk, headers=[(b"authorization", kind)])
        await page.dial()
        assert (await page.sent_away())[0] == 4001, kind


async def test_a_clinics_share_of_sockets(place, bystander, monkeypatch):
    monkeypatch.setattr(clinic_limits, "max_sockets", lambda: 1)
    for kind in (place.source, place.robot):  # of one that ended, the next has its place
        held = kind()
        await held.open()
        one_more = place.robot()
        await one_more.dial()
        await one_more.say({"type": "hello", "version": 1, "base": "null"})
        code, error = await one_more.sent_away()
        assert (code, error["code"]) == (4029, "clinic_full")
        assert "GARRY_CLINIC_SESSIONS" in error["message"]
        await held.hang_up()
