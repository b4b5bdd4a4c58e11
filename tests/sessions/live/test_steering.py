"""What a PT steers beside goal, gain and robot: feedback type, words, chart; what is told of it."""

from __future__ import annotations

import asyncio

import pytest
from asgiref.sync import sync_to_async

from rehab.people.models import Clinic, User
from rehab.sessions.events.snapshot import snapshot
from rehab.sessions.live import orders, runtime
from rehab.sessions.live.session import live_session as sessions
from rehab.sessions.log import SessionEvent
from rehab.sessions.models import TrainingSession
from rehab.training.changes import NotAllowed
from rehab.training.controls import Audience
from rehab.training.phases import make_phase
from rehab.training.valences import CueGestures
from tests.support.callers import PatientPage, change, events_of, restart, turns
from tests.support.world import NOW, set_owner

TWO = (make_phase("training", "First", strides=2), make_phase("training", "Last"))


async def test_the_next_phase_has_the_other_feedback_type_for_everyone(place, begun):
    session = await begun(place, *TWO, valence="positive")
    robot, source = await place.robot().dial(), await place.source().dial()
    tablet, monitor = place.tablet(session), place.monitor(session)
    assert (await robot.hello())["valence"] == "positive"
    await source.hello()
    await tablet.watch()
    shown = await monitor.watch()
    assert (shown["valence"], shown["next_valence"], shown["changed_to"]) == ("positive", "", [])
    assert [one["slug"] for one in shown["types"]] == [
        "positive",
        "negative",
        "binary",
        "explicit",
    ]
    assert (await monitor.change("valence", "negative"))["type"] == "done"
    await monitor.until(lambda event: event.get("next_valence") == "negative")
    await source.walk(2.0, 4.0)  # a miss and a hit of goal 3: the first phase ends
    await tablet.until_step(2)
    assert (tablet.last("step")["points"], tablet.last("step")["score"]) == (1, 1)
    moved = await tablet.until(lambda event: event["kind"] == "phase")
    assert (moved["phase"]["theme"], moved["has_points"], moved["streak"]) == (
        "negative",
        True,
        None,
    )
    cue = await robot.hear("cue")
    assert (cue["valence"], cue["cue"]["above"], cue["cue"]["below"]) == (
        "negative",
        None,
        "varied",
    )
    await source.walk(2.0)
    step = await tablet.until_step(3)
    assert (step["points"], step["score"], step["emblem"]) == (-1, 0, "loss")
    told = await monitor.until(lambda event: event.get("mark", {}).get("kind") == "type")
    assert (told["mark"], told["changed_to"]) == (
        {"after": 2, "kind": "type", "value": "Negative"},
        ["negative"],
    )
    row = await TrainingSession.everywhere.aget(pk=session.pk)
    assert (row.valence, row.changed_to) == ("positive", "negative")
    assert row.valences_label == "Positive, changed to Negative"

    await restart()
    again = await place.monitor(session).watch()
    assert (again["valence"], again["changed_to"], again["score"]) == ("negative", ["negative"], 0)
    assert {"after": 2, "kind": "type", "value": "Negative"} in again["marks"]
    assert (await (await place.robot().dial()).hello())["cue"]["below"] == "varied"
    assert (await place.tablet(session).watch())["last"]["words"] == "Far below."


async def test_a_robot_that_was_silenced_stays_so_in_every_type(place, ready):
    session = await ready(place, *TWO, valence="positive", cue=CueGestures())
    plan = session.to_plan()
    assert [one.cue.above for one in plan.alternatives] == [None] * 3
    other = await ready(place, *TWO, valence="positive", at_station=False)
    cues = {one.slug: one.cue for one in other.to_plan().alternatives}
    assert cues == {
        "negative": CueGestures(below="varied"),
        "binary": CueGestures("varied", "varied"),
        "explicit": CueGestures(),
    }


async def test_without_a_further_phase_the_type_stays(place, begun):
    session = await begun(place)
    monitor = await place.monitor(session).open()
    answer = await monitor.change("valence", "negative")
    assert answer["code"] == "refused"
    assert "No phase with feedback follows" in answer["message"]
    answer = await monitor.change("valence", "happy")
    assert "can be changed to one of: binary, positive" in answer["message"]
    assert await events_of(session, "valence") == []


async def test_a_refusal_is_said_in_the_language_of_its_page(place, begun):
    await Clinic.everywhere.filter(pk=place.clinic.pk).aupdate(language="es")
    session = await begun(place)
    monitor = await place.monitor(session).open()
    answer = await monitor.change("start")
    assert answer["message"] == (
        "Una sesión en marcha no admite el cambio «inicio»; debe estar lista."
    )
    answer = await monitor.change("gain", 0.25)
    assert answer["message"] == "No se puede usar una ganancia de 0,25. Dé una de 0,5 a 1,5."
    await User.everywhere.filter(pk=place.pt.pk).aupdate(language="en")
    monitor = await place.monitor(session).open()
    assert "A gain of 0.25 cannot be used" in (await monitor.change("gain", 0.25))["message"]


async def test_words_and_chart_hold_from_the_next_step_and_are_in_the_log(place, begun):
    session = await begun(place)
    source, tablet, monitor = (
        await place.source().dial(),
        place.tablet(session),
        place.monitor(session),
    )
    await source.hello()
    assert (await tablet.watch())["chart"] == "points"
    assert (await monitor.watch())["words_shown"] is True
    await source.walk(4.0)
    for kind, value in (("words_shown", 0), ("chart_style", "line"), ("chart_style", "line")):
        assert (await monitor.change(kind, value))["type"] == "done"
    await source.walk(4.0)
    before, after = await tablet.until_step(1), await tablet.until_step(2)
    assert (before["words"], before["chart"]) == ("Truly good!", "points")
    assert (after["words"], after["chart"], after["emblem"], after["score"]) == (
        "",
        "line",
        "gain",
        2,
    )
    (words,) = await events_of(session, "words_shown")
    assert (words.old, words.value, words.by_id, words.after_number) == (1, 0, place.pt.pk, 1)
    assert [row.data for row in await events_of(session, "chart_style")] == [
        {"value": "line", "old": "points"},
        {"value": "line", "old": "line"},
    ]
    await restart()
    again = await place.monitor(session).watch()
    assert (again["words_shown"], again["chart"]) == (False, "line")
    assert [mark["kind"] for mark in again["marks"]][:3] == [
        "words_shown",
        "chart_style",
        "chart_style",
    ]


async def test_a_clinic_has_no_more_running_sessions_than_one_process_serves(
    place, elsewhere, ready, begun, monkeypatch
):
    monkeypatch.setattr(orders, "MAX_RUNNING", 2)
    await begun(elsewhere)
    first, second, third = [await ready(place, at_station=False) for _ in range(3)]
    await change(first, "start")
    await change(second, "start")
    with pytest.raises(NotAllowed, match="2 sessions of this clinic are already running"):
        await change(third, "start")
    await change(second, "pause")
    await change(third, "start")
    with pytest.raises(NotAllowed):
        await change(second, "resume")
    await change(first, "finish")
    await change(second, "resume")


async def test_pages_hear_who_paused_a_session(place, begun):
    session = await begun(place)
    tablet, monitor = await place.tablet(session).open(), await place.monitor(session).open()
    await monitor.change("pause")
    heard = await tablet.until(lambda event: event["kind"] == "state")
    assert (heard["state"], heard["pause_reason"]) == ("paused", "therapist")
    await monitor.change("resume")
    await tablet.say({"type": "change", "kind": "pause", "id": "p"})
    await monitor.until(lambda event: event.get("pause_reason") == "patient")
    await monitor.change("resume")
    await runtime.current().drain()
    runtime._current = None
    await sync_to_async(set_owner)(session.clinic_id, "gone|1|1")  # a crash
    await runtime.current().recover()
    shown = await place.monitor(session).watch()
    assert (shown["state"], shown["pause_reason"]) == ("paused", "restart")
    assert (await place.tablet(session).watch())["pause_reason"] == "restart"


async def test_the_monitor_hears_how_long_sensor_and_tablet_are_silent(place, begun):
    session = await begun(place)
    monitor = place.monitor(session)
    there = (await monitor.watch())["presence"]
    assert (there["stride_ago_s"], there["tablets"], there["tablet_ago_s"]) == (None, 0, None)
    source, tablet = await place.source().open(), place.tablet(session)
    await source.walk(4.0)
    seen = await tablet.watch()
    assert seen["presence"] == {"source": True, "ended": False, "robot": False}
    told = await monitor.until(
        lambda event: event["kind"] == "presence" and event["presence"]["tablets"] == 1
    )
    assert told["presence"]["stride_ago_s"] >= 0
    assert told["presence"]["tablet_ago_s"] >= 0


async def test_a_patients_page_counts_wherever_it_is_open_and_its_copy_does_not(place, begun):
    session = await begun(place)
    monitor = await place.monitor(session).open()
    copy = PatientPage(session.pk, "?mirror", user=place.pt)
    await copy.watch()
    page = PatientPage(session.pk, user=place.pt)
    await page.watch()
    await monitor.until(lambda e: e["kind"] == "presence" and e["presence"]["tablets"] == 1)
    await page.hang_up()
    await monitor.until(lambda e: e["kind"] == "presence" and e["presence"]["tablets"] == 0)
    assert max(e["presence"]["tablets"] for e in monitor.events if e["kind"] == "presence") == 1


# --- beside the socket ----------------------------------------------------------------------------


async def test_what_a_page_asks_for_takes_effect_in_its_order(place, begun, stall):
    session = await begun(place)
    monitor = await place.monitor(session).open()
    stall.begin()
    await monitor.say({"type": "change", "kind": "goal", "value": 2.0, "id": "first"})
    await turns()
    other = await place.monitor(session).dial()  # joins: what comes now waits for it
    await turns()
    kinds = ["pause", "resume", "pause", "resume", "pause"]
    for index, kind in enumerate(kinds):
        await monitor.say({"type": "change", "kind": kind, "id": f"c{index}"})
        await monitor.say({"type": "remark", "what": "borg", "value": index, "id": f"r{index}"})
    stall.end()
    await other.hear("snapshot")
    answers = [await monitor.hear("done") for _ in range(11)]
    asked = [f"{what}{index}" for index in range(5) for what in "cr"]
    assert [answer["id"] for answer in answers] == ["first", *asked]
    rows = SessionEvent.everywhere.filter(session=session).order_by("pk")
    kept = [row.value if row.kind == "borg" else row.kind async for row in rows]
    assert kept == ["start", "goal", *[one for pair in enumerate(kinds) for one in pair[::-1]]]


async def test_whoever_waits_for_a_viewer_is_not_overtaken(place, begun, monkeypatch):
    live = await runtime.current().session((await begun(place)).pk)
    order, tasks = [], []

    async def ask(name):
        await live.gate.wait()
        order.append(name)

    def snapshot_meanwhile(*args, **facts):
        tasks.append(asyncio.create_task(ask("later")))  # not yet begun when the subscriber is in
        return snapshot(*args, **facts)

    monkeypatch.setattr(sessions, "snapshot", snapshot_meanwhile)
    settled = asyncio.Event()
    monkeypatch.setattr(live, "wait_until_committed", settled.wait)
    monkeypatch.setattr(live, "uncommitted", 1)
    joining = asyncio.create_task(live.subscribe(Audience.PATIENT, take_frame, NOW))
    await turns()
    tasks.append(asyncio.create_task(ask("earlier")))
    await turns()
    monkeypatch.setattr(live, "uncommitted", 0)
    settled.set()
    await joining
    await asyncio.gather(*tasks)
    assert order == ["earlier", "later"]


async def take_frame(text):
    """Take a frame, and let it be."""


async def test_what_was_asked_is_done_though_the_page_goes_at_once(place, begun):
    session = await begun(place)
    monitor = await place.monitor(session).open()
    await monitor.say({"type": "change", "kind": "pause", "id": "x"})
    await monitor.hang_up()
    await runtime.current().drain()
    assert len(await events_of(session, "pause")) == 1
