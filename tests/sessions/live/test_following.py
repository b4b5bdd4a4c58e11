"""What an owner tells the servers that follow its sessions, and what these read in the log."""

from __future__ import annotations

import asyncio
import json
from types import SimpleNamespace
from typing import Any

from asgiref.sync import sync_to_async
from django.utils import timezone

from rehab.sessions.live import runtime as runtimes
from rehab.sessions.live.servers.following import Follower, load_followed, read_new_rows
from rehab.sessions.live.session.hub import EventFeed
from rehab.sessions.live.session.instruments import REGISTRY
from rehab.training.controls import Audience
from rehab.training.steps import Measurement, Side

PRESENCE = {"robot": True}


async def test_an_owner_hints_once_a_turn_at_what_is_new_and_who_is_there():
    feed = EventFeed()
    hints: list[Any] = []
    reports = {"status": {"battery_share": 0.5}}
    live: Any = SimpleNamespace(
        id=7,
        feed=feed,
        presence=lambda now: PRESENCE,
        robot_orders=SimpleNamespace(reports=reports),
    )
    follower = Follower(live, "another", hints.append)
    feed.subscribers.add(follower)
    event: Any = object()
    feed.publish(event)
    feed.publish(event)
    await asyncio.sleep(0)
    hint = {"session": 7, "presence": PRESENCE, "robot": reports}
    assert hints == [hint]
    follower.queue_heartbeat("")
    await asyncio.sleep(0)
    assert hints == [hint, hint]


def delivered() -> float:
    return REGISTRY.get_sample_value("garry_delivery_seconds_count") or 0.0


async def send_nowhere(_: str) -> None:
    """Send nothing: the test looks into the feed."""


async def test_late_steps_are_not_live_at_a_server_that_heard_no_hint(place, begun):
    session = await begun(place)
    owner = await runtimes.current().session(session.pk)
    followed = await sync_to_async(load_followed)(session.pk)
    await followed.subscribe(Audience.MONITOR, send_nowhere, timezone.now())
    at, count = timezone.now(), 300
    for number in range(1, count + 1):
        step = Measurement(number, 1.1 * number, Side.LEFT, 4.0)
        owner.record_step(step, at, late=number != count)
    await owner.wait_until_committed()
    end = (session.pk, 0, followed.last_event)
    found = await sync_to_async(read_new_rows)([end])
    timed = delivered()
    followed.fold_rows(found[session.pk], at)
    texts = [event.text(Audience.MONITOR) for event in followed.feed.events_after(0)]
    events = [json.loads(text) for text in texts if text is not None]
    lively = {event["number"]: event["live"] for event in events if event["kind"] == "step"}
    assert list(lively) == list(range(1, count + 1))
    assert [number for number, live in lively.items() if live] == [count]
    assert delivered() == timed  # a follower tells nothing of how long a step took
