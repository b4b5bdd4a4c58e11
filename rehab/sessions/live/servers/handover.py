"""How sessions go to another server: given up to a device that waits there, or lost to it."""

from __future__ import annotations

from asgiref.sync import sync_to_async

from rehab.sessions.live.database import owners
from rehab.sessions.live.host import Host
from rehab.sessions.live.session.commits import Fenced
from rehab.sessions.live.supervisor import source_name
from rehab.sessions.models import TrainingSession
from robot.wire.close_codes import CloseCode


async def give_up(host: Host, session_id: int, slot: str) -> bool:
    """Release a session for a device that waits at another server; return whether that is so.

    It goes where its source is, and without one where its robot is. Nothing is lost: what
    is queued is committed first.
    """
    live = host.sessions.get(session_id)
    is_needed = live is None or live.source is not None or host.draining
    if live is None or is_needed or (slot == "robot" and live.robot is not None):
        return False
    if source_name(session_id) in host.supervisor.children:
        return False  # its source dials in here
    del host.sessions[session_id]  # from here on it is closed to everyone
    try:
        await live.wait_until_committed()
        epoch = live.aggregate.session.epoch
        return await sync_to_async(owners.hand_on)(session_id, epoch)
    finally:
        if live.robot is not None:
            moved = "The session moved. Connect again."
            live.robot.evict(CloseCode.ELSEWHERE, "elsewhere", moved)
        host.close_pages(live)


async def drop_taken(host: Host) -> None:
    """Drop the sessions that another server has claimed while this one's lease had expired."""
    there = TrainingSession.everywhere.filter(pk__in=list(host.sessions))
    epochs = dict([row async for row in there.values_list("pk", "epoch")])
    for live in list(host.sessions.values()):
        if epochs.get(live.id, live.aggregate.session.epoch) != live.aggregate.session.epoch:
            host.drop(live, Fenced("Another server has taken the session over."))
            await host.supervisor.stop(source_name(live.id))
