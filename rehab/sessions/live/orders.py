"""What people order of a session: a change, a remark, that its robot stops or may move again.

All take one way: ``Runtime.order`` carries an order out, or sends it to the server that owns the
session, which carries it out. Only a page that stops the robot of a session of this process goes
straight to ``Runtime.stop_robots``: nothing may hold a stop up.
"""

from __future__ import annotations

import time
from typing import Any

from asgiref.sync import sync_to_async
from django.utils import timezone
from msgspec import Struct

from rehab.people.models import User
from rehab.sessions.alarms import ACKNOWLEDGMENTS
from rehab.sessions.live.host import Host
from rehab.sessions.live.session.loading import find_newest_open
from rehab.sessions.live.supervisor import source_name
from rehab.sessions.log import Remark
from rehab.training.changes import ENDED_STATES, Change, NotAllowed, State
from rehab.training.controls import CONTROLS


class ChangeOrder(Struct, frozen=True, tag="change"):
    """Change a session. ``by``: None for a tablet or a command."""

    kind: str
    value: Any
    by: User | None


class RemarkOrder(Struct, frozen=True, tag="remark"):
    """Log a remark."""

    what: Remark
    value: float | None
    by: User


class StopOrder(Struct, frozen=True, tag="stop"):
    """Stop the robot. ``details``: which device ordered it, if it was no person."""

    by: User | None
    details: dict[str, Any] = {}


class ArmOrder(Struct, frozen=True, tag="arm"):
    """Let the robot move again. Always by a person (robot_permissions.py)."""

    by: User


Order = ChangeOrder | RemarkOrder | StopOrder | ArmOrder


async def carry_out(host: Host, session_id: int, order: Order) -> None:
    """Carry out an order for a session of this process; all but a stop is committed by then.

    Raises InvalidSetting if it is refused, NotStored if it could not be committed, and
    OwnedElsewhere where the session is another server's.
    """
    match order:
        case ChangeOrder():
            await _change(host, session_id, order)
        case RemarkOrder():
            live = await host.settled_session(session_id)
            has_ended = live.aggregate.fold.state in ENDED_STATES
            if has_ended and order.what not in ACKNOWLEDGMENTS.values():
                raise NotAllowed("The session has ended.")
            await live.remark(order.what, order.value, order.by, timezone.now())
        case StopOrder():
            host.stop_robots(await host.session(session_id), order.by, order.details)
        case ArmOrder():
            await host.robots.arm(await host.session(session_id), order.by)


async def _change(host: Host, session_id: int, order: ChangeOrder) -> None:
    live = await host.settled_session(session_id)
    if live.source_clock is not None and CONTROLS[order.kind].leads_to is State.RUNNING:
        live.source_clock.resume(time.monotonic())
    await live.change(Change(order.kind, order.value), order.by, timezone.now())
    if live.aggregate.fold.state not in ENDED_STATES:
        return
    await host.supervisor.stop(source_name(live.id))
    if live.station_id is not None:
        waiting = await sync_to_async(find_newest_open)(live.station_id)
        if waiting is not None:
            host.announce(waiting, live.station_id)
