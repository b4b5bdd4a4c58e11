"""What an owner tells the servers that follow its sessions."""

from __future__ import annotations

import asyncio
from types import SimpleNamespace
from typing import Any

from rehab.sessions.live.servers.following import Follower
from rehab.sessions.live.session.hub import EventFeed

PRESENCE = {"robot": True}


async def test_an_owner_hints_once_a_turn_at_what_is_new_and_who_is_there():
    feed = EventFeed()
    hints: list[Any] = []
    reports = {"status": {"battery_share": 0.5}}
    live: Any = SimpleNamespace(
        id=7,
        feed=feed,
        late={3},
        presence=lambda now: PRESENCE,
        robot_orders=SimpleNamespace(reports=reports),
    )
    follower = Follower(live, "another", hints.append)
    feed.subscribers.add(follower)
    event: Any = object()
    feed.publish(event)
    feed.publish(event)
    await asyncio.sleep(0)
    hint = {"session": 7, "late": [3], "presence": PRESENCE, "robot": reports}
    assert hints == [hint]
    follower.queue_heartbeat("")
    await asyncio.sleep(0)
    assert hints == [hint, hint]
