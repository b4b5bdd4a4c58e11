"""The other servers on the database: what this one asks them for, and does for them.

An owner gives hints of its sessions to those that follow them, and does what pages elsewhere ask
for. A server that is not the owner follows, asks, and reports where no answer comes.
"""

from __future__ import annotations

import asyncio
import contextvars
import logging
import time
from collections.abc import Awaitable, Callable, Mapping
from functools import partial

from django.utils import timezone

from rehab.people.models import User
from rehab.sessions.live.database import lease
from rehab.sessions.live.database.own_connection import DatabaseThread
from rehab.sessions.live.database.owners import OwnedElsewhere
from rehab.sessions.live.database.trouble import NotStored
from rehab.sessions.live.host import Host
from rehab.sessions.live.orders import Order, StopOrder, carry_out
from rehab.sessions.live.process import end_tasks
from rehab.sessions.live.recovery import Recovery
from rehab.sessions.live.servers.followed_sessions import FollowedSessions
from rehab.sessions.live.servers.following import FollowedSession, Follower
from rehab.sessions.live.servers.handover import drop_taken, give_up
from rehab.sessions.live.servers.intercom import RECEIPT_S, Data, Intercom, NoAnswer
from rehab.sessions.live.servers.isolation import Isolation
from rehab.sessions.live.servers.order_messages import (
    pack_order,
    pack_refusal,
    raise_refusal,
    unpack_order,
)
from rehab.sessions.live.session.live_session import LiveSession
from rehab.sessions.live.session.loading import find_stopped
from rehab.sessions.payloads import Message
from rehab.training.measures import InvalidSetting
from robot.wire.close_codes import CloseCode

log = logging.getLogger(__name__)

BEAT_S = 1.0  # the log is read so often where no hint comes
READ_TIMEOUT_MS = 5_000


class Servers:
    """The other servers, by their messages."""

    def __init__(self, host: Host, recovery: Recovery, own: lease.Lease) -> None:
        self._host = host
        self._recovery = recovery
        self._own = own
        self._entered = own.entered
        self._isolation = Isolation(own)
        self.is_isolated = False  # cut off from the database, which another server has
        self._addresses: dict[str, str] = {}  # of servers with a valid lease
        self._database = DatabaseThread("garry-follower", READ_TIMEOUT_MS)
        self.followed = FollowedSessions(self._database, self.send_viewers, host.close_pages)
        self.intercom = Intercom(
            own.id,
            {
                "follow": self._on_follow,
                "hint": self._on_hint,
                "order": self._on_order,
                "drive": self._on_drive,
                "opened": self._on_opened,
                "stop_at": self._on_stop_at,
                "give_up": self._on_give_up,
                "lease": self._on_lease,
            },
        )
        loop = asyncio.get_running_loop()
        self._tasks = [
            loop.create_task(work, context=contextvars.Context())
            for work in map(
                self._repeat,
                (self._beat, self._watch_database, self._watch_stops, self.followed.read),
            )
        ]

    async def close(self) -> None:
        """Stop following sessions and receiving messages."""
        await end_tasks(self._tasks)
        await self.intercom.close()
        self._database.close()

    @property
    def silent_s(self) -> float:
        """Seconds since a message to ourselves came back; 0 where they come."""
        silent_s = time.monotonic() - self.intercom.echoed_s
        return silent_s if silent_s > 3 * BEAT_S else 0.0

    def address_of(self, owner: str) -> str:
        """Return how a proxy reaches a server; empty where that is not known."""
        return self._addresses.get(owner, "")

    # --- what this server asks for -----------------------------------------------------------

    async def order(self, owner: str, session_id: int, order: Order) -> None:
        """Have the owner carry out an order. Raises InvalidSetting and NotStored as it does."""
        asked = {"session": session_id, "order": pack_order(order)}
        try:
            raise_refusal(await self.intercom.ask(owner, "order", asked))
        except NoAnswer as problem:
            raise NotStored(f"{problem} Look whether it took effect, then try again.") from None

    def drive_robot(self, owner: str, session_id: int, drive: Mapping[str, float]) -> None:
        """Pass on that a person drives the robot; a lost message counts as a released button."""
        asked = {"session": session_id, "drive": dict(drive)}
        self.intercom.send(owner, "drive", asked, within_s=RECEIPT_S)

    def announce(self, session_id: int, station_id: int) -> None:
        """Notify devices that wait at other servers of a session."""
        self._send_to_all("opened", {"session": session_id, "station": station_id})

    def announce_stop(self, station_id: int, by: User | None, details: Message) -> None:
        """Send a stop to the other servers: sessions of one station share its robot.

        Where that message is lost, they find the stop in the database within a second.
        """
        order = pack_order(StopOrder(by, details))
        self._send_to_all("stop_at", {"station": station_id, "order": order})

    def _send_to_all(self, kind: str, data: Data) -> None:
        for server in self._addresses:
            if server != self._own.id:
                self.intercom.send(server, kind, data)

    async def ask_for(self, owner: str, session_id: int, slot: str) -> bool:
        """Return whether the owner gave a session up to the device that waits here."""
        try:
            answer = await self.intercom.ask(
                owner, "give_up", {"session": session_id, "slot": slot}
            )
        except NoAnswer:
            return False
        return bool(answer.get("given"))

    def send_viewers(self, live: FollowedSession) -> None:
        """Report to the owner at once which pages are here."""
        self.intercom.send(live.owner, "follow", live.viewers)

    async def _beat(self) -> None:
        """Each second: who is there, which pages are here, and the log where no hint came."""
        self.intercom.echo()
        known = self._addresses
        self._addresses = dict(await self._database.run(lease.valid_servers))
        if self._addresses.keys() - known.keys():  # a new server is announced to the others at once
            self._announce_lease()
        self.followed.beat(self._is_gone)
        now_s = asyncio.get_running_loop().time()
        for own in self._host.sessions.values():
            gone_ones = [one for one in _followers(own) if one.is_gone(now_s)]
            own.feed.subscribers.difference_update(gone_ones)
            if gone_ones:
                own.announce_presence(timezone.now())
        if self._entered != self._own.entered:  # others may have taken sessions meanwhile
            await drop_taken(self._host)
            self._entered = self._own.entered
        if self._own.may_judge:
            await self._recovery.take_over_left()
        await asyncio.sleep(BEAT_S)

    async def _watch_database(self) -> None:
        """Each second, whatever the database does: close all sockets once only others have it."""
        self._announce_lease()
        others = self._addresses.keys() - {self._own.id}
        was_isolated, is_silent = self.is_isolated, bool(self.silent_s)
        # No client is admitted before the sessions are dropped that others have taken meanwhile.
        is_behind = was_isolated and self._entered != self._own.entered
        self.is_isolated = is_behind or self._isolation.applies(others, is_silent=is_silent)
        if self.is_isolated and not was_isolated:
            log.critical("This server is cut off from its database; clients go to another one.")
            for socket in list(self._host.sockets):
                socket.close_soon(CloseCode.RESTARTING)
        await asyncio.sleep(BEAT_S)

    def _announce_lease(self) -> None:
        lease = {"current": self._own.is_current, "address": self._own.address}
        self._send_to_all("lease", lease)

    async def _watch_stops(self) -> None:
        """Each second: stop the robots that were stopped at another server."""
        robots = self._host.robots
        await robots.stop_as_stored(lambda stations: self._database.run(find_stopped, stations))
        await asyncio.sleep(BEAT_S)

    def _is_gone(self, owner: str) -> bool:
        return owner not in self._addresses and self._own.may_judge_by(self._addresses)

    async def _repeat(self, work: Callable[[], Awaitable[None]]) -> None:
        while True:
            try:
                await work()
            except Exception:
                log.exception("Other servers' sessions could not be followed")
                await asyncio.sleep(BEAT_S)

    # --- what this server does for others ------------------------------------------------------

    async def _on_follow(self, server: str, viewers: Data) -> None:
        live = self._host.sessions.get(viewers["session"])
        if live is None:
            return
        follower = next((one for one in _followers(live) if one.server == server), None)
        if follower is None:
            follower = Follower(live, server, partial(self.intercom.send, server, "hint"))
            live.feed.subscribers.add(follower)
        before = (follower.tablets, live.is_watched)
        follower.update(viewers, asyncio.get_running_loop().time())
        if viewers["tablets"]:
            live.tablet_seen_at = timezone.now()
        if before != (follower.tablets, live.is_watched):
            live.announce_presence(timezone.now())
        follower.wake()

    async def _on_hint(self, server: str, hint: Data) -> None:
        live = self.followed.sessions.get(hint["session"])
        if live is not None and live.owner == server:
            live.take_hint(hint)
            self.followed.read_soon(live.id)

    async def _on_order(self, server: str, asked: Data) -> Data:
        try:
            await carry_out(self._host, asked["session"], unpack_order(asked["order"]))
        except (InvalidSetting, NotStored) as problem:
            return pack_refusal(problem)
        except OwnedElsewhere as problem:
            return pack_refusal(NotStored(str(problem)))
        return {}

    async def _on_drive(self, server: str, asked: Data) -> None:
        self._host.robots.drive(asked["session"], asked["drive"])

    async def _on_opened(self, server: str, message: Data) -> None:
        self._host.devices.announce(message["session"], message["station"])

    async def _on_stop_at(self, server: str, stop: Data) -> None:
        order = unpack_order(stop["order"])
        if isinstance(order, StopOrder):
            self._host.robots.stop_at(stop["station"], order.by, order.details)

    async def _on_lease(self, server: str, message: Data) -> None:
        self._isolation.record(server, is_current=message["current"])
        if message["current"] and "address" in message:  # the database may be read no more
            self._addresses.setdefault(server, message["address"])

    async def _on_give_up(self, server: str, asked: Data) -> Data:
        return {"given": await give_up(self._host, asked["session"], asked["slot"])}


def _followers(live: LiveSession) -> list[Follower]:
    return [one for one in live.feed.subscribers if isinstance(one, Follower)]
