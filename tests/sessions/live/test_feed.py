"""A session keeps its events only as long as somebody needs them."""

from __future__ import annotations

import asyncio
import json
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager

import pytest

from rehab.sessions.events.event import LiveEvent
from rehab.sessions.live import periodic_tasks
from rehab.sessions.live import runtime as runtimes
from rehab.sessions.live.protocol.outgoing import Outbox
from rehab.sessions.live.session.subscribers import (
    MAX_UNCONFIRMED,
    RING,
    EventFeed,
    Lagged,
    Subscriber,
)
from rehab.training.controls import Audience
from robot.wire.limits import PAGE_HEARTBEAT_S


def an_event(number: int) -> LiveEvent:
    return LiveEvent(number, lambda _: {"kind": "step", "number": number})


async def test_nothing_is_kept_that_all_have_been_sent():
    sent: list[str] = []

    async def send(text: str) -> None:
        sent.append(text)

    feed = EventFeed()
    feed.publish(an_event(1))
    assert not feed._ring  # nobody is there
    quick, slow = (Subscriber(feed, Audience.MONITOR, send) for _ in range(2))
    feed.subscribers |= {quick, slow}
    for number in range(2, 12):
        feed.publish(an_event(number))
        await quick._send_pending()
    assert len(feed._ring) == 10  # for the slow one
    assert [event.number for event in feed.events_after(slow.position)] == list(range(2, 12))
    await slow._send_pending()
    assert not feed._ring
    feed.subscribers.discard(slow)
    feed.publish(an_event(12))
    await quick._send_pending()
    assert not feed._ring


async def test_what_a_subscriber_misses_is_limited():
    feed = EventFeed()
    slow = Subscriber(feed, Audience.MONITOR, None)
    feed.subscribers.add(slow)
    for number in range(RING + 1):
        feed.publish(an_event(number))
    assert len(feed._ring) == RING
    with pytest.raises(Lagged):
        feed.events_after(slow.position)


async def test_pages_have_a_heartbeat_each_interval_unless_they_were_just_sent_a_step(
    place, elsewhere, begun, monkeypatch
):
    monkeypatch.setattr(periodic_tasks, "ROBOT_HEARTBEAT_S", 0.005)
    tablets, sessions = [], []
    for somewhere in (place, elsewhere):
        session = await begun(somewhere)
        tablets.append(somewhere.tablet(session))
        await tablets[-1].watch()
        sessions.append(session.pk)
    for tablet in tablets:
        await tablet.hear("heartbeat")
        await tablet.hear("heartbeat")
    source = await place.source().open()
    live = await runtimes.current().session(sessions[0])
    page = next(one for one in live.feed.subscribers if one.audience is Audience.PATIENT)
    await source.walk(4.0)
    await tablets[0].until_step(1)
    queued: list[str] = []  # from here on: a beat may come before the step is stored
    monkeypatch.setattr(page, "queue_heartbeat", queued.append)
    await tablets[1].hear("heartbeat")
    await tablets[1].hear("heartbeat")
    assert not queued
    page._sent_s -= PAGE_HEARTBEAT_S / 2  # long ago, as a page sees it
    for _ in range(periodic_tasks.PAGE_BEATS):
        await runtimes.current().routines._send_page_heartbeats()
    assert queued


class Page:
    """A socket that takes texts at once, while it is not behind."""

    def __init__(self) -> None:
        self.written: list[str] = []
        self.awaited: list[str] = []
        self.is_behind = False

    def write(self, text: str) -> bool:
        if not self.is_behind:
            self.written.append(text)
        return not self.is_behind

    async def send(self, text: str) -> None:
        self.awaited.append(text)


@asynccontextmanager
async def subscribed(
    audience: Audience = Audience.PATIENT,
) -> AsyncIterator[tuple[Page, Subscriber]]:
    page, feed = Page(), EventFeed()
    subscriber = Subscriber(feed, audience, page.send, page.write)
    feed.subscribers.add(subscriber)
    pumping = asyncio.create_task(subscriber.pump())
    await asyncio.sleep(0)
    yield page, subscriber
    pumping.cancel()


async def test_a_turns_events_are_written_at_its_end_as_one_frame():
    async with subscribed() as (page, subscriber):
        subscriber.feed.publish(an_event(1))
        subscriber.feed.publish(an_event(2))
        assert page.written == []
        await asyncio.sleep(0)
        (frame,) = map(json.loads, page.written)
        assert [event["number"] for event in frame["events"]] == [1, 2]
        assert (frame["frame"], page.awaited, list(subscriber.feed._ring)) == (1, [], [])


async def test_what_has_to_wait_is_sent_by_the_pump_once_and_in_order():
    async with subscribed() as (page, subscriber):
        page.is_behind = True
        subscriber.feed.publish(an_event(1))
        await asyncio.sleep(0.01)
        page.is_behind = False
        subscriber.feed.publish(an_event(2))
        await asyncio.sleep(0.01)
        frames = [json.loads(text) for text in page.awaited + page.written]
        assert [event["number"] for one in frames for event in one["events"]] == [1, 2]
        assert [one["frame"] for one in frames] == [1, 2]
        assert len(page.awaited) == 1


async def test_nothing_is_written_before_what_the_pump_is_sending():
    sending, page = asyncio.Event(), Page()

    async def send(text: str) -> None:
        await sending.wait()
        page.written.append(text)

    feed = EventFeed()
    subscriber = Subscriber(feed, Audience.PATIENT, send, page.write)
    feed.subscribers.add(subscriber)
    feed.publish(an_event(1))  # the pump has not begun: it will send this
    pumping = asyncio.create_task(subscriber.pump())
    await asyncio.sleep(0.01)
    feed.publish(an_event(2))
    await asyncio.sleep(0.01)
    assert page.written == []
    sending.set()
    await asyncio.sleep(0.01)
    frames = [json.loads(text) for text in page.written]
    assert [event["number"] for one in frames for event in one["events"]] == [1, 2]
    pumping.cancel()


async def test_a_page_that_confirms_nothing_is_written_to_no_more():
    async with subscribed() as (page, subscriber):
        for number in range(MAX_UNCONFIRMED + 5):
            subscriber.feed.publish(an_event(number + 1))
            await asyncio.sleep(0)
        await asyncio.sleep(0.01)
        assert len(page.written) == MAX_UNCONFIRMED
        subscriber.confirm(MAX_UNCONFIRMED)
        await asyncio.sleep(0.01)
        (rest,) = map(json.loads, page.awaited)
        assert len(rest["events"]) == 5


async def test_a_robot_gets_each_event_once():
    async with subscribed(Audience.ROBOT) as (page, subscriber):
        subscriber.feed.publish(an_event(1))
        await asyncio.sleep(0)
        subscriber.feed.publish(an_event(2))
        subscriber.feed.publish(an_event(3))
        await asyncio.sleep(0.01)
        numbers = [json.loads(text)["number"] for text in page.written + page.awaited]
        assert numbers == [1, 2, 3]


async def test_an_ack_covers_the_ones_before_it():
    page = Page()
    outbox = Outbox(page.send, page.write)
    running = asyncio.create_task(outbox.pump())
    await asyncio.sleep(0)
    outbox.acknowledge(1)
    outbox.acknowledge(2)
    await asyncio.sleep(0)
    assert [json.loads(text)["number"] for text in page.written] == [2]
    page.is_behind = True
    outbox.acknowledge(3)
    await asyncio.sleep(0)
    page.is_behind = False
    outbox.acknowledge(4)
    await asyncio.sleep(0.01)
    told = [json.loads(text)["number"] for text in page.awaited + page.written[1:]]
    assert told[-1] == 4
    assert told == sorted(set(told))
    running.cancel()


async def test_one_call_of_the_loop_writes_to_all(monkeypatch):
    loop, calls = asyncio.get_running_loop(), []
    pages = [Page() for _ in range(3)]

    def fail(_: str) -> bool:
        raise OSError

    monkeypatch.setattr(pages[1], "write", fail)
    outboxes = [Outbox(page.send, page.write) for page in pages]
    running = [asyncio.create_task(outbox.pump()) for outbox in outboxes]
    await asyncio.sleep(0)
    call_soon = loop.call_soon

    def count(function, *args, **options):
        calls.append(function)
        return call_soon(function, *args, **options)

    monkeypatch.setattr(loop, "call_soon", count)
    for outbox in outboxes:
        outbox.acknowledge(1)
        outbox.acknowledge(2)
    assert len(calls) == 1
    await asyncio.sleep(0.01)
    ack = '{"type":"ack","number":2}'
    assert [page.written for page in pages] == [[ack], [], [ack]]
    assert pages[1].awaited == [ack]  # what could not be written is sent
    for one in running:
        one.cancel()
