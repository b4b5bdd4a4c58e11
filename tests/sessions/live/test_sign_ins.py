"""A page's socket lives as long as its sign-in; a training that runs on it keeps that alive."""

from __future__ import annotations

from datetime import timedelta

import pytest
from asgiref.sync import sync_to_async
from django.contrib.sessions.models import Session
from django.utils import timezone

from rehab.people.consent.models import Purpose
from rehab.people.consent.services import record_consent, withdraw_consent
from rehab.people.models import Clinic, User
from rehab.people.roles import Role
from rehab.people.sign_in.sign_in_expiry import SIGNED_IN_AT, SessionStore, digest_of
from rehab.sessions.live import auth, periodic_tasks
from rehab.sessions.live import runtime as runtimes
from rehab.stations.models import Device
from tests.support.callers import sign_in

pytestmark = pytest.mark.django_db(transaction=True)


@pytest.fixture(autouse=True)
def _hasty(monkeypatch):
    monkeypatch.setattr(periodic_tasks, "ROBOT_HEARTBEAT_S", 0.002)


async def end_in(key: str, minutes: float) -> None:
    """Let a sign-in end soon."""
    end = timezone.now() + timedelta(minutes=minutes)
    await Session.objects.filter(pk=digest_of(key)).aupdate(expire_date=end)


async def minutes_left(key: str) -> float:
    row = await Session.objects.aget(pk=digest_of(key))
    return (row.expire_date - timezone.now()).total_seconds() / 60


async def test_a_running_training_keeps_its_therapist_signed_in(place, begun, settings):
    settings.SESSION_MINUTES = 30
    session = await begun(place)
    monitor = await place.monitor(session).open()
    await end_in(sign_in(place.pt), 1)
    while await minutes_left(sign_in(place.pt)) < 29:
        await monitor.hear("heartbeat")
    await monitor.change("pause")  # nobody walks: a page left open is nobody who is there
    await end_in(sign_in(place.pt), 1)
    await runtimes.current().routines.check_sign_ins()
    assert await minutes_left(sign_in(place.pt)) <= 1
    await end_in(sign_in(place.pt), -1)
    assert (await monitor.sent_away())[0] == 4001


async def test_a_working_day_ends_though_a_training_runs(place, begun, settings):
    session = await begun(place)
    store = await sync_to_async(_signed_in_since)(sign_in(place.pt), 11.9, settings)
    await place.monitor(session).open()
    await runtimes.current().routines.check_sign_ins()
    assert await minutes_left(store) <= 6


def _signed_in_since(key: str, hours: float, settings) -> str:
    settings.SESSION_MINUTES = 30
    store = SessionStore(key)
    store[SIGNED_IN_AT] = int((timezone.now() - timedelta(hours=hours)).timestamp())
    store.save()
    return key


async def test_tablets_of_open_sessions_are_asked_for_together(place, begun, monkeypatch):
    """A query for each of a thousand took 0.4 s every 5 s only to be built."""

    def ask(*_: object) -> bool:
        raise AssertionError("The session is open, and its tablet may show it.")

    await place.tablet(await begun(place)).watch()
    monkeypatch.setattr(auth, "_is_visible", ask)
    clients = [(one.actor, one.scope) for one in runtimes.current().sockets]
    assert len(clients) == 1
    assert await auth.find_unauthorized(clients, timezone.now()) == []


async def test_a_tablet_goes_with_the_account_that_let_it_in(place, begun):
    session = await begun(place)
    tablet = place.tablet(session)
    await tablet.watch()
    await User.everywhere.filter(clinic=place.clinic.pk).aupdate(is_active=False)
    assert (await tablet.sent_away())[0] == 4001
    again = await place.tablet(session).dial()
    assert (await again.sent_away())[0] == 4001
    await place.source().open()  # a program has no approver


@pytest.mark.postgres
@pytest.mark.parametrize("who", ["tablet", "monitor"])
async def test_pages_outside_the_clinics_networks_end_when_they_come_to_be(place, begun, who):
    session = await begun(place)
    page = getattr(place, who)(session)
    await page.watch()
    agree = sync_to_async(record_consent)
    await agree(place.patient, Purpose.REMOTE, None, timezone.now())
    await name_networks(place)
    await runtimes.current().routines.check_sign_ins()
    assert page.code is None
    await sync_to_async(withdraw_consent)(place.patient, Purpose.REMOTE, None, timezone.now())
    assert (await page.sent_away())[0] == 4001
    again = await getattr(place, who)(session).dial()
    assert (await again.sent_away())[0] == 4004


@pytest.mark.parametrize("who", ["tablet", "monitor"])
async def test_pages_inside_the_clinics_networks_stay_open(place, begun, who):
    page = await getattr(place, who)(await begun(place)).open()
    await name_networks(place, "0.0.0.0/32")  # where sockets of tests come from
    await runtimes.current().routines.check_sign_ins()
    await page.overhear()
    assert page.code is None


async def name_networks(place, networks: str = "192.168.7.0/24") -> None:
    await Clinic.everywhere.filter(pk=place.clinic.pk).aupdate(networks=networks)


async def test_a_new_password_ends_open_sockets(place, begun):
    monitor = await place.monitor(await begun(place)).open()
    place.pt.set_password("walk well again 2026")
    await place.pt.asave()
    assert (await monitor.sent_away())[0] == 4001


@pytest.mark.parametrize("change", ["role", "clinic"])
async def test_other_rights_end_open_sockets(place, begun, change):
    monitor = await place.monitor(await begun(place)).open()
    if change == "role":
        place.pt.role = Role.RESEARCHER
    else:
        place.pt.clinic = await Clinic.everywhere.acreate(name="another one")
    await place.pt.asave()
    assert (await monitor.sent_away())[0] == 4001


async def test_a_clinic_that_comes_to_ask_for_a_second_factor_closes_sockets(place, begun):
    session = await begun(place)
    monitor = await place.monitor(session).open()
    await Clinic.everywhere.filter(pk=place.clinic.pk).aupdate(second_factor_required=True)
    assert (await monitor.sent_away())[0] == 4001
    again = await place.monitor(session).dial()
    assert (await again.sent_away())[0] == 4001


async def test_all_sign_ins_are_checked_a_few_at_a_time(place, begun, monkeypatch):
    monkeypatch.setattr(periodic_tasks, "CHECKED_SOCKETS", 1)
    monkeypatch.setattr(periodic_tasks, "CHECK_PAUSE_S", 0.0)
    session = await begun(place)
    pages = [place.monitor(session) for _ in range(3)]
    for page in pages:
        await page.watch()
    await pages[0].change("pause")
    await end_in(sign_in(place.pt), -1)
    for page in pages:
        assert (await page.sent_away())[0] == 4001


async def test_a_device_that_stays_connected_was_heard_just_now(place, begun):
    """It is heard for hours by one connection; its station's page must not count from the first."""
    session = await begun(place)
    robot, tablet = await place.robot().open(), await place.tablet(session).open()
    long_ago = timezone.now() - timedelta(minutes=11)
    await Device.everywhere.filter(station=place.station).aupdate(last_seen_at=long_ago)
    await runtimes.current().routines.check_sign_ins()
    seen = Device.everywhere.filter(station=place.station).order_by("kind")
    heard = {one.kind: one.last_seen_at > long_ago async for one in seen}
    assert (heard["robot"], heard["tablet"], heard["source"]) == (True, True, False)
    await robot.hang_up()
    await tablet.hang_up()
