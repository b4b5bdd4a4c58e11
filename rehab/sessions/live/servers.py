"""The other servers on the database: what this one asks them for, and does for them.

An owner gives hints of its sessions to those that follow them, and does what pages elsewhere ask
for. A server that is not the owner follows, asks, and says where no answer comes.
"""

from __future__ import annotations

import asyncio
import contextvars
import logging
import time
from collections.abc import Awaitable, Callable, Mapping
from functools import partial
from typing import Any, Protocol

from django.utils import timezone

from rehab.people.models import User
from rehab.sessions.live import lease
from rehab.sessions.live.answers import pack, raise_refusal
from rehab.sessions.live.following import (
    FollowedSession,
    Follower,
    load_followed,
    read_new_rows,
)
from rehab.sessions.live.intercom import HEARD_S, Data, Intercom, Unheard
from rehab.sessions.live.own_connection import DatabaseThread
from rehab.sessions.live.owners import OwnedElsewhere
from rehab.sessions.live.session import LiveSession, NotStored
from rehab.sessions.log import Remark
from rehab.sessions.payloads import Message
from rehab.training.changes import ChangeValue
from rehab.training.measures import InvalidSetting

log = logging.getLogger(__name__)

BEAT_S = 1.0  # the log is read so often where no hint comes
UNUSED_BEATS = 3  # after so many without a page a session is not followed any more
READ_TIMEOUT_MS = 5_000
READ_PAUSE_S = 0.005  # between two reads: hints that come meanwhile are read together


class Owning(Protocol):
    """What a runtime does for other servers with the sessions that it owns."""

    sessions: dict[int, LiveSession]
    sockets: set[Any]

    async def change_own(
        self, session_id: int, kind: str, value: ChangeValue, by: User | None
    ) -> None: ...
    async def remark_own(
        self, session_id: int, what: Remark, value: float | None, by: User
    ) -> None: ...
    async def order_own_robot(
        self, session_id: int, order: str, by: User | None, device_id: int | None
    ) -> None: ...
    def drive_own_robot(self, session_id: int, drive: Mapping[str, float]) -> None: ...
    def announce_here(self, session_id: int, station_id: int) -> None: ...
    def stop_at(self, station_id: int, by: User | None, told: Message) -> None: ...
    async def give_up(self, session_id: int, slot: str) -> bool: ...
    async def take_over_left(self) -> None: ...
    async def drop_taken(self) -> None: ...
    def close_pages(self, live: LiveSession) -> None: ...


class Servers:
    """The other servers, by what is heard of them."""

    def __init__(self, owning: Owning, own: lease.Lease) -> None:
        self._owning = owning
        self._own = own
        self._entered = own.entered
        self.followed: dict[int, FollowedSession] = {}
        self._opening: dict[int, asyncio.Task[None]] = {}
        self._unused: dict[int, int] = {}  # beats
        self._addresses: dict[str, str] = {}  # of servers with a valid lease
        self._hinted: set[int] = set()
        self._read_due = asyncio.Event()
        self.intercom = Intercom(
            own.id,
            {
                "follow": self._on_follow,
                "hint": self._on_hint,
                "change": self._on_change,
                "remark": self._on_remark,
                "order": self._on_order,
                "drive": self._on_drive,
                "opened": self._on_opened,
                "stop_at": self._on_stop_at,
                "give_up": self._on_give_up,
            },
        )
        self._database = DatabaseThread("garry-follower", READ_TIMEOUT_MS)
        loop = asyncio.get_running_loop()
        self._tasks = [
            loop.create_task(work, context=contextvars.Context())
            for work in (self._repeat(self._beat), self._repeat(self._read))
        ]

    async def close(self) -> None:
        """End: nobody is followed, and nothing is heard any more."""
        for task in self._tasks:
            task.cancel()
        await asyncio.gather(*self._tasks, return_exceptions=True)
        await self.intercom.close()
        self._database.close()

    @property
    def deaf_s(self) -> float:
        """Seconds since a message to ourselves came back; 0 where they come."""
        silent_s = time.monotonic() - self.intercom.echoed_s
        return silent_s if silent_s > 3 * BEAT_S else 0.0

    def address_of(self, owner: str) -> str:
        """Return how a proxy reaches a server; empty where that is not known."""
        return self._addresses.get(owner, "")

    # --- what this server asks for -----------------------------------------------------------

    async def change(
        self, owner: str, session_id: int, kind: str, value: ChangeValue, by: User | None
    ) -> None:
        """Have the owner apply a change. Raises InvalidSetting and NotStored as it does."""
        asked = {"session": session_id, "kind": str(kind), "value": value}
        await self._ask(owner, "change", asked | {"by": by and by.pk})

    async def remark(
        self, owner: str, session_id: int, what: Remark, value: float | None, by: User
    ) -> None:
        """Have the owner log a remark."""
        asked = {"session": session_id, "what": what.value, "value": value}
        await self._ask(owner, "remark", asked | {"by": by.pk})

    async def order_robot(
        self, owner: str, session_id: int, order: str, by: User | None, device_id: int | None
    ) -> None:
        """Have the owner stop the robot or let it move. Raises NotStored where it does not."""
        asked = {"session": session_id, "order": order, "device": device_id}
        await self._ask(owner, "order", asked | {"by": by and by.pk})

    def drive_robot(self, owner: str, session_id: int, drive: Mapping[str, float]) -> None:
        """Pass on that a person drives the robot; what is lost is as if the button was let go."""
        asked = {"session": session_id, "drive": dict(drive)}
        self.intercom.tell(owner, "drive", asked, within_s=HEARD_S)

    def announce(self, session_id: int, station_id: int) -> None:
        """Tell devices that wait at other servers of a session."""
        self._tell_all("opened", {"session": session_id, "station": station_id})

    def tell_of_stop(self, station_id: int, by: User | None, told: Message) -> None:
        """Tell other servers of a stop: sessions of one station share its robot."""
        self._tell_all("stop_at", {"station": station_id, "by": by and by.pk, "told": told})

    def _tell_all(self, kind: str, data: Data) -> None:
        for server in self._addresses:
            if server != self._own.id:
                self.intercom.tell(server, kind, data)

    async def ask_for(self, owner: str, session_id: int, slot: str) -> bool:
        """Return whether the owner gave a session up to the device that waits here."""
        try:
            answer = await self.intercom.ask(
                owner, "give_up", {"session": session_id, "slot": slot}
            )
        except Unheard:
            return False
        return bool(answer.get("given"))

    async def _ask(self, owner: str, kind: str, asked: Data) -> None:
        try:
            raise_refusal(await self.intercom.ask(owner, kind, asked))
        except Unheard as problem:
            raise NotStored(f"{problem} Look whether it took effect, then try again.") from None

    # --- sessions of others -------------------------------------------------------------------

    async def follow(self, session_id: int) -> FollowedSession:
        """Return a session of another server, as it is told here.

        Raises TrainingSession.DoesNotExist.
        """
        while (live := self.followed.get(session_id)) is None:
            if session_id not in self._opening:
                self._opening[session_id] = asyncio.get_running_loop().create_task(
                    self._open(session_id), context=contextvars.Context()
                )
            task = self._opening[session_id]
            try:
                await asyncio.shield(task)
            finally:
                if task.done():
                    self._opening.pop(session_id, None)
        self._unused[session_id] = 0
        return live

    async def _open(self, session_id: int) -> None:
        live = await self._database.run(load_followed, session_id)
        self.followed[session_id] = live
        self._unused[session_id] = 0
        self.intercom.tell(live.owner, "follow", live.viewers)
        self._read_soon(session_id)

    def leave(self, session_id: int) -> None:
        """Follow a session no more; its pages connect again, and find who has it now."""
        live = self.followed.pop(session_id, None)
        self._unused.pop(session_id, None)
        if live is not None:
            self._owning.close_pages(live)

    def tell_viewers(self, live: FollowedSession) -> None:
        """Tell the owner at once which pages are here."""
        self.intercom.tell(live.owner, "follow", live.viewers)

    def _read_soon(self, session_id: int) -> None:
        self._hinted.add(session_id)
        self._read_due.set()

    async def _read(self) -> None:
        """Read what the logs of followed sessions have got, of all that have news at once."""
        await self._read_due.wait()
        self._read_due.clear()
        hinted, self._hinted = self._hinted, set()
        wanted = [self.followed[key] for key in sorted(hinted) if key in self.followed]
        if not wanted:
            return
        ends = [(live.id, live.aggregate.fold.last_number, live.last_event) for live in wanted]
        found = await self._database.run(read_new_rows, ends)
        for live in wanted:
            new = found.get(live.id)
            if self.followed.get(live.id) is not live:
                continue
            if new is None or new.owner != live.owner:
                self.leave(live.id)
                continue
            try:
                live.fold_rows(new, timezone.now())
            except Exception:  # it is rebuilt from its log
                log.exception("Session %s could not be followed", live.id)
                self.leave(live.id)
        await asyncio.sleep(READ_PAUSE_S)

    async def _beat(self) -> None:
        """Each second: who is there, which pages are here, and the log where no hint came."""
        self.intercom.echo()
        servers = await self._database.run(lease.valid_servers)
        self._addresses = dict(servers)
        for live in list(self.followed.values()):
            gone = live.owner not in self._addresses and self._own.may_judge
            self._unused[live.id] = 0 if live.feed.subscribers else self._unused[live.id] + 1
            if gone or self._unused[live.id] > UNUSED_BEATS:
                self.leave(live.id)
            else:
                self.tell_viewers(live)
                self._read_soon(live.id)
        now_s = asyncio.get_running_loop().time()
        for own in self._owning.sessions.values():
            gone_ones = [one for one in _followers(own) if one.is_gone(now_s)]
            own.feed.subscribers.difference_update(gone_ones)
            if gone_ones:
                own.announce_presence(timezone.now())
        if self._entered != self._own.entered:  # others may have taken sessions meanwhile
            await self._owning.drop_taken()
            self._entered = self._own.entered
        if self._own.may_judge:
            await self._owning.take_over_left()
        await asyncio.sleep(BEAT_S)

    async def _repeat(self, work: Callable[[], Awaitable[None]]) -> None:
        while True:
            try:
                await work()
            except Exception:
                log.exception("Other servers' sessions could not be followed")
                await asyncio.sleep(BEAT_S)

    # --- what this server does for others ------------------------------------------------------

    async def _on_follow(self, server: str, viewers: Data) -> None:
        live = self._owning.sessions.get(viewers["session"])
        if live is None:
            return
        follower = next((one for one in _followers(live) if one.server == server), None)
        if follower is None:
            follower = Follower(live, server, partial(self.intercom.tell, server, "hint"))
            live.feed.subscribers.add(follower)
        before = (follower.tablets, live.is_watched)
        follower.hear(viewers, asyncio.get_running_loop().time())
        if viewers["tablets"]:
            live.tablet_heard_at = timezone.now()
        if before != (follower.tablets, live.is_watched):
            live.announce_presence(timezone.now())
        follower.wake()

    async def _on_hint(self, server: str, hint: Data) -> None:
        live = self.followed.get(hint["session"])
        if live is not None and live.owner == server:
            live.take_hint(hint)
            self._read_soon(live.id)

    async def _on_change(self, server: str, asked: Data) -> Data:
        value, by = asked["value"], _account(asked["by"])
        return await _answer(self._owning.change_own(asked["session"], asked["kind"], value, by))

    async def _on_remark(self, server: str, asked: Data) -> Data:
        what, by = Remark(asked["what"]), User(pk=asked["by"])
        return await _answer(self._owning.remark_own(asked["session"], what, asked["value"], by))

    async def _on_order(self, server: str, asked: Data) -> Data:
        by, device = _account(asked["by"]), asked["device"]
        return await _answer(
            self._owning.order_own_robot(asked["session"], asked["order"], by, device)
        )

    async def _on_drive(self, server: str, asked: Data) -> None:
        self._owning.drive_own_robot(asked["session"], asked["drive"])

    async def _on_opened(self, server: str, told: Data) -> None:
        self._owning.announce_here(told["session"], told["station"])

    async def _on_stop_at(self, server: str, stop: Data) -> None:
        self._owning.stop_at(stop["station"], _account(stop["by"]), stop["told"])

    async def _on_give_up(self, server: str, asked: Data) -> Data:
        return {"given": await self._owning.give_up(asked["session"], asked["slot"])}


def _followers(live: LiveSession) -> list[Follower]:
    return [one for one in live.feed.subscribers if isinstance(one, Follower)]


def _account(key: int | None) -> User | None:
    """Return an account as a row refers to it: a stop waits for no query."""
    return None if key is None else User(pk=key)


async def _answer(work: Awaitable[None]) -> Data:
    try:
        await work
    except (InvalidSetting, NotStored) as problem:
        return pack(problem)
    except OwnedElsewhere as problem:
        return pack(NotStored(str(problem)))
    return {}
