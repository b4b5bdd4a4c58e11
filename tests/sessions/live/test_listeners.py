"""Who may listen to a session, who no longer may, and what is kept in memory for nobody."""

from __future__ import annotations

import asyncio
from typing import Any

import pytest
from asgiref.sync import sync_to_async
from django.contrib.sessions.models import Session
from django.utils import timezone

from rehab.people.consent.models import Purpose
from rehab.people.consent.services import record_consent, withdraw_consent
from rehab.people.models import Clinic, User
from rehab.people.roles import Role
from rehab.people.sign_in.sign_in_expiry import digest_of
from rehab.sessions.live import periodic_tasks
from rehab.sessions.live import runtime as runtimes
from tests.support.callers import (
    MonitorPage,
    PatientPage,
    change,
    sign_in,
)


async def test_from_elsewhere_people_and_tablets_watch_with_consent_alone(place, begun):
    session = await begun(place)
    await sync_to_async(Clinic.everywhere.update)(networks="192.168.1.0/24")

    async def code_of(
        kind: type[PatientPage | MonitorPage], address: str, **who: Any
    ) -> int | None:
        page = kind(session.pk, **who)
        page.wire.scope["client"] = (address, 1)
        if address == "192.168.1.7":
            await page.watch()
            await page.hang_up()
            return None
        await page.dial()
        return (await page.sent_away())[0]

    for kind in (PatientPage, MonitorPage):
        assert await code_of(kind, "192.168.1.7", user=place.pt) is None
        assert await code_of(kind, "203.0.113.9", user=place.pt) == 4004
    assert await code_of(PatientPage, "192.168.1.7", token=place.tokens["tablet"]) is None
    assert await code_of(PatientPage, "203.0.113.9", token=place.tokens["tablet"]) == 4004


async def test_a_tablets_open_socket_goes_with_the_consent_that_it_needs(place, begun):
    session = await begun(place)
    await sync_to_async(Clinic.everywhere.update)(networks="192.168.1.0/24")
    now = timezone.now()
    await sync_to_async(record_consent)(place.patient, Purpose.REMOTE, None, now)
    tablet = place.tablet(session)
    tablet.wire.scope["client"] = ("203.0.113.9", 1)
    await tablet.watch()
    await sync_to_async(withdraw_consent)(place.patient, Purpose.REMOTE, None, now)
    await runtimes.current().routines.check_sign_ins()
    assert (await tablet.sent_away())[0] == 4001


@pytest.mark.parametrize(
    "origin",
    [
        *("https://evil.example", None, "http://localhost.evil.example"),
        "http://localhost:9000",  # another program of the same machine
        "http://localhost",
        "https://localhost:8000",
        "http://127.0.0.1:8000",  # another name of the server: cookies are not shared with it
        "http://user@localhost:8001",
    ],
)
async def test_cookies_count_on_sockets_of_our_own_pages_only(place, begun, origin):
    session = await begun(place)
    for kind in (PatientPage, MonitorPage):
        page = kind(session.pk, user=place.pt, origin=origin)
        await page.dial()
        assert (await page.sent_away())[0] == 4001


@pytest.mark.parametrize(
    ("headers", "origin"),
    [
        ([], "http://localhost:8000"),
        ([(b"host", b"127.0.0.1")], "http://127.0.0.1"),
        ([(b"host", b"[::1]:8000")], "http://[::1]:8000"),
    ],
)
async def test_cookies_count_from_every_name_of_the_server(place, begun, headers, origin):
    session = await begun(place)
    await MonitorPage(session.pk, user=place.pt, headers=headers, origin=origin).watch()


async def test_behind_a_proxy_the_scheme_is_the_browsers(place, begun, settings):
    settings.SECURE_PROXY_SSL_HEADER = ("HTTP_X_FORWARDED_PROTO", "https")
    settings.ALLOWED_HOSTS = ["garry.example"]
    session = await begun(place)
    proxied = [(b"host", b"garry.example:443"), (b"x-forwarded-proto", b"https")]
    for origin in ("https://garry.example", "https://garry.example:443"):
        await MonitorPage(session.pk, user=place.pt, headers=proxied, origin=origin).watch()
    page = MonitorPage(session.pk, user=place.pt, headers=proxied, origin="http://garry.example")
    await page.dial()
    assert (await page.sent_away())[0] == 4001


async def test_a_switched_off_account_opens_nothing(place, begun):
    session = await begun(place)
    place.pt.is_active = False
    await sync_to_async(place.pt.save)()
    page = await place.monitor(session).dial()
    assert (await page.sent_away())[0] == 4001


async def test_open_sockets_end_with_their_token_or_sign_in(place, begun, monkeypatch):
    monkeypatch.setattr(periodic_tasks, "ROBOT_HEARTBEAT_S", 0.002)
    session = await begun(place)
    source, robot = await place.source().open(), await place.robot().open()
    tablet, monitor = await place.tablet(session).open(), await place.monitor(session).open()
    other = await MonitorPage(session.pk, user=place.people[Role.LEAD]).open()
    for name in ("source", "tablet"):  # one revoked, one renewed
        device = place.devices[name]
        if name == "source":
            device.revoked_at = timezone.now()
        else:
            device.new_token()
        await device.asave()
    assert (await source.sent_away())[0] == 4001
    assert (await tablet.sent_away())[0] == 4001
    await Session.objects.filter(session_key=digest_of(sign_in(place.pt))).adelete()  # signed out
    assert (await monitor.sent_away())[0] == 4001
    await robot.hear("heartbeat")
    assert other.code is None
    await User.everywhere.filter(pk=place.people[Role.LEAD].pk).aupdate(is_active=False)
    assert (await other.sent_away())[0] == 4001


async def test_idle_sessions_leave_memory_but_not_while_someone_comes(place, ready, monkeypatch):
    monkeypatch.setattr(periodic_tasks, "ROBOT_HEARTBEAT_S", 0.001)
    session = await ready(place)
    runtime = runtimes.current()
    live = await runtime.session(session.pk)
    while session.pk in runtime.sessions:  # noqa: ASYNC110
        await asyncio.sleep(0.001)
    assert (await runtime.session(session.pk)) is not live
    monkeypatch.setattr(periodic_tasks, "ROBOT_HEARTBEAT_S", 60)
    tablet = await place.tablet(session).open()
    await change(session, "start")
    await tablet.until(lambda event: event["kind"] == "state")
    await tablet.hang_up()
    assert not runtime.sessions[session.pk].feed.subscribers
    assert not runtime.sockets
    assert not runtime.devices.connected_ids()
