"""What people order of a session: a change or a remark, by a page, the API or a command.

All take one way: ``Runtime.order``, in the process that the clinic lives in. What a robot is
ordered goes straight to ``StationRobots``: nothing may hold a stop up.
"""

from __future__ import annotations

from typing import Any

from asgiref.sync import sync_to_async
from django.utils import timezone
from msgspec import Struct

from rehab.people.models import User
from rehab.sessions.alarms import ACKNOWLEDGMENTS, check_no_open_fall
from rehab.sessions.live.database.trouble import NotStored
from rehab.sessions.live.host import Host
from rehab.sessions.live.session.live_session import LiveSession
from rehab.sessions.live.session.loading import find_newest_open
from rehab.sessions.live.supervisor import source_name
from rehab.sessions.log import Remark
from rehab.training.changes import ENDED_STATES, Change, NotAllowed, State
from rehab.training.controls import CONTROLS

AFTER_THE_END = {*ACKNOWLEDGMENTS.values(), Remark.FALL_SEVERITY}  # may be noted then, too
MAX_RUNNING = 1_000  # sessions of a clinic: one process serves them all (docs/capacity.md)


class ChangeOrder(Struct, frozen=True):
    """Change a session. ``by``: None for a tablet or a command."""

    kind: str
    value: Any
    by: User | None


class RemarkOrder(Struct, frozen=True):
    """Log a remark."""

    what: Remark
    value: float | None
    by: User


Order = ChangeOrder | RemarkOrder


async def carry_out(host: Host, session_id: int, order: Order) -> None:
    """Carry out an order for a session; it is committed by then.

    Raises InvalidSetting if it is refused, NotStored if it could not be committed, and
    OwnedElsewhere where the clinic lives in another process.
    """
    live = await host.settled_session(session_id)
    if isinstance(order, ChangeOrder):
        await _change(host, live, order)
    elif live.aggregate.fold.state in ENDED_STATES and order.what not in AFTER_THE_END:
        raise NotAllowed("The session has ended.")
    else:
        await live.remark(order.what, order.value, order.by, timezone.now())


async def _change(host: Host, live: LiveSession, order: ChangeOrder) -> None:
    if CONTROLS[order.kind].leads_to is State.RUNNING:
        _check_room(host, live)
        await _check_no_open_fall(host, live)
        if live.source_clock is not None:
            live.source_clock.resume()
    await live.change(Change(order.kind, order.value), order.by, timezone.now())
    if live.aggregate.fold.state not in ENDED_STATES:
        return
    await host.supervisor.stop(source_name(live.id))
    if live.station_id is not None:
        waiting = await sync_to_async(find_newest_open)(live.station_id)
        if waiting is not None:
            host.announce(waiting, live.station_id)


async def _check_no_open_fall(host: Host, live: LiveSession) -> None:
    """Raise NotAllowed where the patient's fall is open, also in another session.

    Steps and orders that come meanwhile take effect after this one.
    """
    with live.gate.closed():
        await sync_to_async(check_no_open_fall)(live.id, timezone.now())
    if host.sessions.get(live.id) is not live:
        raise NotStored("It could not be stored. Try again.")


def _check_room(host: Host, live: LiveSession) -> None:
    """Raise NotAllowed where as many sessions of the clinic run as one process serves."""
    there = (one for one in host.sessions.values() if one.clinic_id == live.clinic_id)
    if sum(one.is_running for one in there) >= MAX_RUNNING:
        raise NotAllowed(
            "{limit} sessions of this clinic are already running. End one of them first.",
            limit=MAX_RUNNING,
        )
