"""Pages and robots: what each hears, from a snapshot on, and who may listen at all."""

from __future__ import annotations

import asyncio
import random
import threading
from collections import Counter
from collections.abc import Callable
from typing import Any

import pytest
from asgiref.sync import ThreadSensitiveContext, sync_to_async
from django.contrib.sessions.models import Session
from django.utils import timezone

from rehab.people.models import Clinic, User
from rehab.people.roles import Role
from rehab.sessions.live import hub, owners
from rehab.sessions.live import runtime as runtimes
from rehab.sessions.live.actor import SessionActor
from rehab.sessions.live.backlog import PAGE
from rehab.sessions.live.session import LiveSession
from rehab.sessions.log import Remark, SessionEvent
from rehab.sessions.services import SessionRequest, change_session, create_session
from rehab.training.changes import ChangeKind
from rehab.training.goals import GoalRule
from rehab.training.phases import make_phase
from tests.support.callers import (
    Caller,
    Message,
    MonitorPage,
    Page,
    PatientPage,
    a_step,
    build_place,
    change,
    sign_in,
    turns,
)

PHASES = (
    make_phase("training", strides=4),
    make_phase("catch", strides=2),
    make_phase("training", gain=0.9),
)
TOTALS = [
    *("number", "state", "score", "phase", "goal", "gain", "hit_rate"),
    *("activation_threshold", "robot_intensity"),
]


def apply(page: Page) -> Message:
    """Give a page's totals: its first snapshot and all events after it."""
    totals = dict(page.heard[0])
    for event in page.events:
        match event["kind"]:
            case "step":
                totals |= {
                    name: event[name]
                    for name in ("number", "score", "streak", "hit_rate")
                    if name in event
                }
            case "missing" | "calm":
                totals["number"] = event["number"]
            case "state":
                totals["state"] = event["state"]
            case "phase":
                totals |= {k: event[k] for k in ("phase", "goal", "gain", "obstacle") if k in event}
            case "goal" | "gain":
                totals[event["kind"]] = event[event["kind"]]
            case "activation_threshold" | "robot_intensity":
                totals[event["kind"]] = event["value"]
    return totals


@pytest.mark.parametrize("valence", ["positive", "negative", "binary", "explicit"])
async def test_snapshot_and_events_give_a_fresh_snapshot(place, ready, valence):
    chance = random.Random(f"live {valence}")
    session = await ready(place, *PHASES, valence=valence)
    source = await place.source().dial()
    await source.hello()
    pages = [place.tablet(session), place.monitor(session)]
    for page in pages:
        await page.watch()
    await change(session, "start")
    for round_ in range(40):
        kinds = ["goal", "gain", "pause", "phase", "threshold", "robot"]
        kind = chance.choice(["step"] * 6 + kinds)
        if kind == "step":
            value = chance.choice([None, 2.0, 3.0, 4.0, 99.0])
            await source.walk(value, side=chance.choice(["left", "left", "right"]))
        elif kind == "pause":
            await change(session, "pause")
            await source.walk(4.0)
            await change(session, "resume")
        elif kind == "phase":
            await change(session, "phase", chance.randrange(3))
        elif kind == "threshold":
            await change(session, "activation_threshold", chance.choice([0.8, 0.9]))
        elif kind == "robot":
            await change(session, "robot_intensity", chance.choice([0, 0.5, 1]))
        else:
            await change(session, kind, {"goal": 3.5, "gain": 1.1}[kind])
        if round_ % 8 == 7:
            for page in pages:
                await page.overhear()
                fresh = type(page)(session.pk, user=place.pt)
                shown = await fresh.watch()
                names = [name for name in TOTALS if name in shown]
                totals = apply(page)
                if isinstance(page, PatientPage):
                    # The patient hears nothing of the other leg's steps, not even their number.
                    names.remove("number")
                assert {n: totals[n] for n in names} == {n: shown[n] for n in names}
                await fresh.hang_up()


async def test_after_gives_exactly_the_missing_steps_once(place, begun):
    session = await begun(place)
    source = await place.source().dial()
    await source.hello()
    count = 600
    for first in range(1, count, 200):
        await source.say({"type": "steps", "steps": [a_step(first + i) for i in range(200)]})
        await source.acked(first + 199)
    for after, page in (
        (0, place.tablet(session, "?after=0")),
        (577, place.monitor(session, "?after=577")),
    ):
        assert (await page.watch())["number"] == count
        await page.overhear()
        while len([m for m in page.heard if m["type"] == "steps"]) < (3 if after == 0 else 1):
            await page.hear("steps")
        frames = [m for m in page.heard if m["type"] == "steps"]
        got = [step["number"] for frame in frames for step in frame["steps"]]
        assert got == list(range(after + 1, count + 1))
        assert [frame["frame"] for frame in frames] == list(range(1, len(frames) + 1))
    up_to_date = place.tablet(session, f"?after={count}")
    await up_to_date.watch()
    source.number = count
    await source.walk(4.0)
    await up_to_date.until_step(count + 1)
    assert not [m for m in up_to_date.heard if m["type"] == "steps"]


async def test_a_long_past_is_fed_as_fast_as_it_is_read(place, begun):
    """A page asks for 5,000 steps and reads slowly; a page beside it notices nothing."""
    session = await begun(place)
    source = await place.source().dial()
    await source.hello()
    count = 5_000
    for first in range(1, count, 200):
        await source.say({"type": "steps", "steps": [a_step(first + i) for i in range(200)]})
        await source.acked(first + 199)
    source.number = count
    beside = place.monitor(session)
    await beside.watch()
    slow = place.tablet(session, "?after=0")
    await slow.watch()
    while len(frames_of_past(slow)) < hub.MAX_UNSEEN_PAST:
        await slow.hear("steps")
    await source.walk(*[4.0] * 20)
    await beside.until_step(count + 20)
    await Caller.overhear(slow)
    past = frames_of_past(slow)
    assert len(past) == hub.MAX_UNSEEN_PAST  # not one more before it has read one
    assert max(len(frame["steps"]) for frame in past) <= PAGE
    while len(numbers_of(slow)) < count:
        await slow.say({"type": "seen", "frame": frames_of_past(slow)[-1]["frame"]})
        await slow.hear("steps")
    await slow.until_step(count + 20)
    assert numbers_of(slow) == list(range(1, count + 21))


async def test_a_page_that_reads_none_of_its_past_is_let_go(place, begun, monkeypatch):
    monkeypatch.setattr(hub, "UNSEEN_S", 0.05)
    session = await begun(place)
    source = await place.source().dial()
    await source.hello()
    for first in range(1, 2000, 200):
        await source.say({"type": "steps", "steps": [a_step(first + i) for i in range(200)]})
        await source.acked(first + 199)
    page = place.tablet(session, "?after=0")
    await page.watch()
    code, error = await page.sent_away()
    assert (code, error["code"]) == (4008, "unseen")
    live = await runtimes.current().session(session.pk)
    assert not live.channel.viewers


def frames_of_past(page: Page) -> list[Message]:
    return [message for message in page.heard if message["type"] == "steps"]


def numbers_of(page: Page) -> list[int]:
    old: list[int] = [s["number"] for m in page.heard if m["type"] == "steps" for s in m["steps"]]
    return old + page.steps


async def test_nothing_is_missed_or_doubled_when_a_page_joins_under_way(place, begun):
    session = await begun(place)
    source = await place.source().dial()
    await source.hello()
    pages = []
    for number in range(1, 60):
        await source.say(a_step(number))
        if number % 10 == 0:
            page = await place.tablet(session, "?after=0").dial()
            pages.append(page)
    await source.acked(59)
    for page in pages:
        await page.hear("snapshot")
        while len(numbers_of(page)) < 59:
            await page.hear()
        snapshot, *_ = [m for m in page.heard if m["type"] == "snapshot"]
        old = [s["number"] for m in page.heard if m["type"] == "steps" for s in m["steps"]]
        assert numbers_of(page) == list(range(1, 60))
        assert old == list(range(1, snapshot["number"] + 1))


async def test_nothing_is_shown_before_it_is_committed(place, begun, stall):
    session = await begun(place)
    source = await place.source().dial()
    await source.hello()
    tablet, robot = place.tablet(session), await place.robot().dial()
    await tablet.watch()
    await robot.hello()
    await turns()
    stall.begin()
    await source.say(a_step(1))
    await turns()
    late_comer = await place.monitor(session).dial()
    assert [m["type"] for m in await late_comer.overhear()] == []
    assert not tablet.steps
    await tablet.overhear()
    assert not tablet.steps
    stall.end()
    await tablet.until_step(1)
    await robot.hear("step")
    assert (await late_comer.hear("snapshot"))["number"] == 1


async def test_a_slow_page_gets_fewer_and_larger_frames(place, begun):
    session = await begun(place)
    source = await place.source().dial()
    await source.hello()
    slow, quick = place.tablet(session), place.monitor(session)
    slow.confirms = False
    await slow.watch()
    await quick.watch()
    for _ in range(hub.MAX_UNSEEN + 30):
        await source.walk(4.0)
        await quick.until_step(source.number)
    await slow.overhear()
    frames = [m for m in slow.heard if m["type"] == "events"]
    assert len(frames) == hub.MAX_UNSEEN
    await slow.say({"type": "seen", "frame": frames[-1]["frame"]})
    await slow.until_step(source.number)
    frames = [m for m in slow.heard if m["type"] == "events"]
    assert len(frames) == hub.MAX_UNSEEN + 1
    assert len(frames[-1]["events"]) >= 28
    assert slow.steps == quick.steps == list(range(1, source.number + 1))


async def test_a_page_that_confirms_nothing_is_sent_away_alone(place, begun, monkeypatch):
    monkeypatch.setattr(hub, "UNSEEN_S", 0.02)
    session = await begun(place)
    source = await place.source().dial()
    await source.hello()
    deaf, quick = place.tablet(session), place.monitor(session)
    await deaf.watch()
    await quick.watch()
    for _ in range(hub.MAX_UNSEEN + 2):
        await source.walk(4.0)
        await quick.until_step(source.number)
    code, error = await deaf.sent_away()
    assert (code, error["code"]) == (4008, "unseen")
    assert "?after=" in error["message"]
    await source.walk(4.0)
    await quick.until_step(source.number)
    live = await runtimes.current().session(session.pk)
    assert len(live.channel.viewers) == 1


async def test_a_page_that_lags_beyond_the_ring_begins_anew(place, begun):
    session = await begun(place)
    source = await place.source().dial()
    await source.hello()
    slow = place.tablet(session)
    slow.confirms = False
    await slow.watch()
    for _ in range(hub.MAX_UNSEEN):
        await source.walk(4.0)
    for first in range(source.number + 1, source.number + 600, 200):
        await source.say({"type": "steps", "steps": [a_step(first + i) for i in range(200)]})
        await source.acked(first + 199)
    await slow.overhear()
    assert slow.heard[-1]["type"] == "events"
    await slow.say({"type": "seen", "frame": slow.heard[-1]["frame"]})
    snapshot = await slow.hear("snapshot")
    assert snapshot["number"] == 632
    assert snapshot["score"] == 632
    assert [step["number"] for step in snapshot["steps"]] == list(range(573, 633))
    source.number = 632
    await source.walk(2.0)
    assert (await slow.until_step(633))["score"] == 631


# --- what each hears ------------------------------------------------------------------------------


async def test_a_patient_hears_no_values_where_there_is_no_feedback(place, begun):
    session = await begun(place, make_phase("catch", strides=3), make_phase("training"))
    tablet, monitor, robot = place.tablet(session), place.monitor(session), place.robot()
    await tablet.watch()
    await monitor.watch()
    await (await robot.dial()).hello()
    source = await place.source().dial()
    await source.hello()
    await source.walk(4.017, 2.0)
    await source.walk(4.0, side="right")
    await source.walk(None)
    await monitor.until_step(4)
    await tablet.until(lambda event: event["kind"] == "phase")
    heard = [e for e in tablet.events if e["kind"] not in ("presence", "phase")]
    assert [(e["kind"], e["number"]) for e in heard] == [("calm", 1), ("calm", 2), ("calm", 4)]
    assert [e["phase_strides"] for e in heard] == [1, 2, 0]
    assert set(heard[0]) == {"kind", "number", "active_s", "phase_s", "phase_strides"}
    await source.walk(4.0, side="right")
    await source.walk(25.0)
    await source.walk(3.3)
    step = await tablet.until_step(7)
    assert (step["kind"], step["performance"], step["shown"]) == ("step", 1.1, None)
    assert [e["kind"] for e in tablet.events if e.get("number") == 6] == ["missing"]
    await monitor.until_step(7)
    assert monitor.steps == [1, 2, 3, 4, 5, 6, 7]
    assert (await monitor.until_step(1))["value"] == 4.017
    assert (await monitor.until_step(3))["side"] == "right"
    assert (await monitor.until_step(6))["reasons"] == ["out_of_bounds"]
    heard = await robot.hear("step")
    assert (heard["number"], heard["performance"]) == (7, pytest.approx(1.1))
    everything = str(tablet.heard)
    for secret in ("4.017", "'goal'", "code-elm", "25.0", "value"):
        assert secret not in everything
    assert "nick-elm" in everything


FEEDBACK: dict[str, list[tuple[Any, ...]]] = {
    "positive": [(1, 1, "gain", 1), (0, 1, "neutral", 0)],
    "negative": [(0, 0, "neutral", None), (-1, -1, "loss", None)],
    "binary": [(1, 1, "gain", 1), (-1, 0, "loss", 0)],
    "explicit": [(None, None, "neutral", None), (None, None, "neutral", None)],
}


@pytest.mark.parametrize("valence", FEEDBACK)
async def test_a_step_carries_the_feedback_of_its_valence(place, begun, valence):
    session = await begun(place, valence=valence)
    tablet = place.tablet(session)
    await tablet.watch()
    source = await place.source().dial()
    await source.hello()
    await source.walk(3.6, 2.0)
    await tablet.until_step(2)
    for number, (points, score, emblem, streak) in enumerate(FEEDBACK[valence], start=1):
        step = await tablet.until_step(number)
        assert (step["points"], step["score"]) == (points, score)
        assert (step["emblem"], step["streak"]) == (emblem, streak)
        assert step["shown"] == ((3.6, 2.0)[number - 1] if valence == "explicit" else None)
        praises = step["confetti"] != "none"
        assert praises == (number == 1 and valence in ("positive", "binary"))
        assert step["live"] is True


async def test_a_robot_hears_its_cue_states_and_steps(place, begun, ready, monkeypatch):
    monkeypatch.setattr(runtimes, "HEARTBEAT_S", 0.005)
    session = await begun(place)
    robot = await place.robot().dial()
    welcome = await robot.hello()
    assert welcome["cue"]["above"] == "celebrate"
    assert welcome["cue"]["threshold"] == 0.9
    monitor = place.monitor(session)
    await monitor.watch()
    await robot.hear("heartbeat")
    await change(session, "activation_threshold", 0.8)
    assert (await robot.hear("cue"))["cue"]["threshold"] == 0.8
    await change(session, "pause")
    assert (await robot.hear("state"))["state"] == "paused"
    await robot.say({"type": "report", "report": {"gesture": "celebrate"}})
    assert (await monitor.until(lambda e: e["kind"] == "robot"))["report"]["gesture"] == "celebrate"
    await change(session, "abort")
    assert (await robot.hear("state"))["state"] == "aborted"
    old = await runtimes.current().session(session.pk)
    later = await ready(place)
    assert (await robot.hear("welcome"))["session"] == later.pk
    await turns()
    assert len(old.channel.viewers) == 1  # the monitor's: the robot listens to the new one alone


async def test_a_robot_waits_for_a_session_at_its_station(place, ready):
    robot = await place.robot().dial()
    assert await robot.hello() == {"type": "welcome", "session": None}
    await robot.say({"type": "report", "report": {"pose": [0, 0, 0]}})
    session = await ready(place)
    assert (await robot.hear("welcome"))["session"] == session.pk


async def test_pages_hear_a_heartbeat(place, begun, monkeypatch):
    monkeypatch.setattr(runtimes, "HEARTBEAT_S", 0.002)
    session = await begun(place)
    tablet = place.tablet(session)
    await tablet.watch()
    await tablet.hear("heartbeat")


async def test_no_heartbeat_waits_for_the_disk(place, begun, ready, monkeypatch):
    monkeypatch.setattr(runtimes, "HEARTBEAT_S", 0.002)
    disk, database = threading.Event(), asyncio.Event()
    waiting: set[str] = set()

    def move_log() -> None:
        waiting.add("checkpoint")
        assert disk.wait(10)

    def release(*_: Any) -> None:
        waiting.add("release")
        assert disk.wait(10)

    async def keep_signed_in(*_: Any) -> None:
        waiting.add("sign-ins")
        await database.wait()

    session = await begun(place)
    robot, tablet = await place.robot().dial(), place.tablet(session)
    await robot.hello()
    await tablet.watch()
    monkeypatch.setattr(runtimes, "_checkpoint", move_log)
    monkeypatch.setattr(runtimes, "keep_signed_in", keep_signed_in)
    monkeypatch.setattr(owners, "release", release)
    await runtimes.current().session((await ready(place, at_station=False)).pk)  # soon idle
    while len(waiting) < 3:
        await robot.hear("heartbeat")
    await robot.overhear()
    for _ in range(50):
        await robot.hear("heartbeat")
    await tablet.overhear()
    for _ in range(3):
        await tablet.hear("heartbeat")
    assert not disk.is_set()
    disk.set()
    database.set()


async def test_heartbeats_and_housekeeping_go_on_whatever_fails(place, begun, monkeypatch, caplog):
    monkeypatch.setattr(runtimes, "HEARTBEAT_S", 0.002)
    failed: Counter[str] = Counter()

    def fail(what: str) -> Callable[..., None]:
        def failing(*_: Any) -> None:
            failed[what] += 1
            raise RuntimeError(what)

        return failing

    session = await begun(place)
    robot = await place.robot().dial()
    await robot.hello()
    for name in ("_checkpoint", "keep_signed_in"):
        monkeypatch.setattr(runtimes, name, fail(name))
    with monkeypatch.context() as patch:
        patch.setattr(LiveSession, "is_watched", property(fail("robots")))
        patch.setattr(LiveSession, "presence", fail("pages"))
        patch.setattr(LiveSession, "is_idle", property(fail("idle")))
        while len(failed) < 5 or min(failed.values()) < 2:  # noqa: ASYNC110
            await asyncio.sleep(0.001)
    await robot.overhear()
    await robot.hear("heartbeat")
    await place.tablet(session).watch()
    told = {str(record.exc_info[1]) for record in caplog.records if record.exc_info}
    assert told == set(failed)


# --- pages steer, also from a request's thread ----------------------------------------------------


async def test_a_page_of_the_site_may_create_and_change_sessions(place, elsewhere):
    """In the thread and context of a request, as Django runs its views."""
    source = await place.source().dial()
    await source.hello()
    robot = await place.robot().dial()
    await robot.hello()

    def view():
        session = create_session(
            SessionRequest(
                patient=place.patient,
                valence="positive",
                goal=GoalRule(value=3.0),
                phases=PHASES,
                station=place.station,
            )
        )
        change_session(session, ChangeKind.START, by=place.pt)
        change_session(session, ChangeKind.GOAL, 4.0, by=place.pt)
        return session

    async with ThreadSensitiveContext():
        session = await sync_to_async(view)()
    assert (await source.hear("welcome"))["session"] == session.pk
    assert (await robot.hear("welcome"))["session"] == session.pk
    await source.overhear()
    source.number = 0
    await source.walk(4.0)
    await robot.hear("step")
    assert runtimes.current().sessions[session.pk].actor.fold.goal == 4.0


# --- who may listen -------------------------------------------------------------------------------


async def test_who_may_open_which_page(place, elsewhere, begun):
    session = await begun(place)
    neighbor = await sync_to_async(build_place)("neighbor", place.clinic)
    tries: list[tuple[Message, int | None, int | None]] = [
        ({}, 4001, 4001),
        ({"token": "wrong"}, 4001, 4001),
    ]
    for role, user in place.people.items():
        closed = None if role in (Role.LEAD, Role.PT) else 4004
        tries.append(({"user": user}, closed, closed))
    tries += [({"user": user}, 4004, 4004) for user in elsewhere.people.values()]
    tries += [
        ({"token": place.tokens["tablet"]}, None, 4004),
        ({"token": place.tokens["source"]}, 4004, 4004),
        ({"token": place.tokens["robot"]}, 4004, 4004),
    ]
    for other in (neighbor, elsewhere):
        tries += [({"token": token}, 4004, 4004) for token in other.tokens.values()]
    tries.append(({"user": neighbor.pt}, None, None))
    for options, patient, monitor in tries:
        for kind, expected in ((PatientPage, patient), (MonitorPage, monitor)):
            page = kind(session.pk, **options)
            if expected is None:
                await page.watch()
                await page.hang_up()
            else:
                await page.dial()
                code, error = await page.sent_away()
                assert code == expected, (options, kind)
                assert error["message"]
                assert len(page.heard) == 1


async def test_from_elsewhere_people_watch_with_consent_and_the_tablet_stays(place, begun):
    session = await begun(place)
    await sync_to_async(Clinic.everywhere.update)(networks="192.168.1.0/24")

    async def code_of(
        kind: type[PatientPage | MonitorPage], address: str, **who: Any
    ) -> int | None:
        page = kind(session.pk, **who)
        page.wire.scope["client"] = (address, 1)
        if address == "192.168.1.7" or "token" in who:
            await page.watch()
            await page.hang_up()
            return None
        await page.dial()
        return (await page.sent_away())[0]

    for kind in (PatientPage, MonitorPage):
        assert await code_of(kind, "192.168.1.7", user=place.pt) is None
        assert await code_of(kind, "203.0.113.9", user=place.pt) == 4004
    assert await code_of(PatientPage, "203.0.113.9", token=place.tokens["tablet"]) is None


@pytest.mark.parametrize("origin", ["https://evil.example", None, "http://localhost.evil.example"])
async def test_cookies_count_on_sockets_of_our_own_pages_only(place, begun, origin):
    session = await begun(place)
    for kind in (PatientPage, MonitorPage):
        page = kind(session.pk, user=place.pt, origin=origin)
        await page.dial()
        assert (await page.sent_away())[0] == 4001


async def test_cookies_count_from_every_name_of_the_server(place, begun):
    session = await begun(place)
    for origin in ("http://localhost:8000", "http://127.0.0.1", "http://[::1]:8000"):
        await MonitorPage(session.pk, user=place.pt, origin=origin).watch()


async def test_a_switched_off_account_opens_nothing(place, begun):
    session = await begun(place)
    place.pt.is_active = False
    await sync_to_async(place.pt.save)()
    page = await place.monitor(session).dial()
    assert (await page.sent_away())[0] == 4001


async def test_open_sockets_end_with_their_token_or_sign_in(place, begun, monkeypatch):
    monkeypatch.setattr(runtimes, "HEARTBEAT_S", 0.002)
    session = await begun(place)
    source, robot = await place.source().dial(), await place.robot().dial()
    await source.hello()
    await robot.hello()
    tablet, monitor = place.tablet(session), place.monitor(session)
    other = MonitorPage(session.pk, user=place.people[Role.LEAD])
    for page in (tablet, monitor, other):
        await page.watch()
    for name in ("source", "tablet"):  # one revoked, one renewed
        device = place.devices[name]
        if name == "source":
            device.revoked_at = timezone.now()
        else:
            device.new_token()
        await device.asave()
    assert (await source.sent_away())[0] == 4001
    assert (await tablet.sent_away())[0] == 4001
    await Session.objects.filter(session_key=sign_in(place.pt)).adelete()  # signed out
    assert (await monitor.sent_away())[0] == 4001
    await robot.hear("heartbeat")
    assert other.code is None
    await User.everywhere.filter(pk=place.people[Role.LEAD].pk).aupdate(is_active=False)
    assert (await other.sent_away())[0] == 4001


# --- memory ---------------------------------------------------------------------------------------


async def test_idle_sessions_leave_memory_but_not_while_someone_comes(place, ready, monkeypatch):
    monkeypatch.setattr(runtimes, "HEARTBEAT_S", 0.001)
    session = await ready(place)
    runtime = runtimes.current()
    live = await runtime.session(session.pk)
    while session.pk in runtime.sessions:  # noqa: ASYNC110
        await asyncio.sleep(0.001)
    assert (await runtime.session(session.pk)) is not live
    monkeypatch.setattr(runtimes, "HEARTBEAT_S", 60)
    tablet = place.tablet(session)
    await tablet.watch()
    await change(session, "start")
    await tablet.until(lambda event: event["kind"] == "state")
    await tablet.hang_up()
    assert not runtime.sessions[session.pk].channel.viewers
    assert not runtime.sockets
    assert not any(runtime.waiting.values())


# --- what is noted with one tap -------------------------------------------------------------------


async def test_remarks_are_kept_in_the_log_and_alter_no_score(place, begun):
    session = await begun(place)
    source = await place.source().dial()
    await source.hello()
    await source.walk(4.0, 4.0)
    monitor, other, tablet = place.monitor(session), place.monitor(session), place.tablet(session)
    for page in (monitor, other, tablet):
        await page.watch()
    for index, what in enumerate(Remark):
        value = {"value": 7} if what is Remark.BORG else {}
        await monitor.say({"type": "remark", "what": what.value, "id": f"r{index}", **value})
        assert (await monitor.hear("done"))["id"] == f"r{index}"
        seen = await other.until(lambda event, what=what: event.get("what") == what.value)
        assert (seen["number"], seen["value"]) == (2, 7.0 if value else None)
    await source.walk(4.0)
    assert (await tablet.until_step(3))["score"] == 3
    assert not [event for event in tablet.events if event["kind"] == "remark"]
    rows = SessionEvent.everywhere.filter(session=session, kind__in=list(Remark)).order_by("pk")
    kept = [row async for row in rows.values_list("kind", "after_number", "value", "by")]
    assert kept == [
        (what.value, 2, 7.0 if what is Remark.BORG else None, place.pt.pk) for what in Remark
    ]
    rebuilt = await sync_to_async(SessionActor.load)(session)
    assert rebuilt.fold.score == 3
    marks = [
        {"after": 2, "kind": what.value, "value": 7.0 if what is Remark.BORG else None}
        for what in Remark
    ]
    assert list(rebuilt.marks) == (await place.monitor(session).watch())["marks"] == marks


async def test_what_cannot_be_noted(place, begun):
    session = await begun(place)
    tablet, monitor = place.tablet(session), place.monitor(session)
    for page in (tablet, monitor):
        await page.watch()
    await tablet.say({"type": "remark", "what": "pain", "id": "r"})
    assert (await tablet.hear("error"))["code"] == "refused"
    await change(session, "abort")
    await monitor.say({"type": "remark", "what": "pain", "id": "r"})
    assert (await monitor.hear("error"))["message"] == "The session has ended."
    for bad in ({"what": "joy"}, {"what": "borg"}, {"what": "borg", "value": 11}, {}):
        page = place.monitor(session)
        await page.watch()
        await page.say({"type": "remark", "id": "r", **bad})
        assert (await page.sent_away())[0] == 4400
