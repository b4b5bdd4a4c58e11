"""The other servers on the database: whose clinics come here, and whether only they have it.

Servers send each other nothing but a question after their state, and that only while one lacks the
database. What it was sent then would wait unstored, while another server takes the clinics over:
so its clients are sent there. Where no server reaches the database, clients stay and are told.
"""

from __future__ import annotations

import asyncio
import contextvars
import http.client
import logging
from collections.abc import Awaitable, Callable, Collection

from asgiref.sync import sync_to_async
from django.conf import settings

from rehab.sessions.live.database import clinic_owners, server_lease
from rehab.sessions.live.host import Host
from rehab.sessions.live.process import end_tasks
from rehab.sessions.live.recovery import Recovery
from robot.wire.close_codes import CloseCode

log = logging.getLogger(__name__)

BEAT_S = 1.0
THOROUGH = 60  # beats between two looks also for owners without a lease; each looks twice
ASK_S = 1.0  # within which another server answers


def ask_if_ready(address: str) -> bool | None:
    """Return whether a server says that it has the database; None where it does not answer."""
    host = settings.ALLOWED_HOSTS[0].lstrip(".") if settings.ALLOWED_HOSTS else address
    headers = {"Host": address if host == "*" else host, "X-Forwarded-Proto": "https"}
    server = http.client.HTTPConnection(address, timeout=ASK_S)
    try:
        server.request("GET", "/readyz", headers=headers)
        return server.getresponse().status == 200
    except (OSError, http.client.HTTPException):
        return None
    finally:
        server.close()


class Servers:
    """This server among the others.

    Parameters
    ----------
    ask
        Returns whether the server at an address has the database; None where it does not answer.
    """

    def __init__(
        self,
        host: Host,
        recovery: Recovery,
        own: server_lease.Lease,
        ask: Callable[[str], bool | None] = ask_if_ready,
    ) -> None:
        self._host = host
        self._recovery = recovery
        self._own = own
        self._ask = ask
        self._entered = own.entered
        self._beats = 0
        self._is_cut_off = False
        self.is_isolated = False  # cut off from the database, which another server has
        loop = asyncio.get_running_loop()
        self._tasks = [
            loop.create_task(self._repeat(work), context=contextvars.Context())
            for work in (self._beat, self._watch_database)
        ]

    async def close(self) -> None:
        """Stop watching."""
        await end_tasks(self._tasks)

    @property
    def may_move_robots(self) -> bool:
        """Whether no other server may have taken the clinics: a robot obeys one owner alone."""
        return self._own.is_current and self._entered == self._own.entered

    async def _beat(self) -> None:
        """Each second: drop what others took, take over what is left, go where clinics belong."""
        if (entered := self._own.entered) != self._entered:
            taken = await sync_to_async(clinic_owners.find_taken)(self._host.clinics.epochs)
            for clinic_id in taken:
                self._host.lose(clinic_id)
            self._entered = entered
        if self._own.may_judge:
            self._beats += 1
            await self._recovery.take_over_left(thorough=self._beats % THOROUGH < 2)
        if self._own.is_ready:
            await self._move_idle()

    async def _move_idle(self) -> None:
        """Release clinics that belong to another server, while no session there is open."""
        open_ones = {one.clinic_id for one in self._host.sessions.values() if one.is_open}
        for clinic_id in self._host.clinics:
            place = server_lease.find_place(clinic_id, self._own.servers)
            if clinic_id not in open_ones and place is not None and place.id != self._own.id:
                await self._host.give_up(clinic_id)

    async def _watch_database(self) -> None:
        """Each second, whatever the database does: close all sockets once only others have it."""
        was_isolated = self.is_isolated
        # No client is admitted before the clinics are dropped that others have taken meanwhile.
        is_behind = was_isolated and self._entered != self._own.entered
        # Twice: after an outage of the database another server may be back a moment earlier.
        was_cut_off, self._is_cut_off = self._is_cut_off, await self._look_if_cut_off()
        self.is_isolated = is_behind or (was_cut_off and self._is_cut_off)
        if self.is_isolated and not was_isolated:
            log.critical("This server is cut off from its database; clients go to another one.")
            for socket in list(self._host.sockets):
                socket.close_soon(CloseCode.RESTARTING)

    async def _look_if_cut_off(self) -> bool:
        others = [one.address for one in self._own.servers if one.id != self._own.id]
        if self._own.is_current or not others:
            return False
        answers = await asyncio.gather(*(asyncio.to_thread(self._ask, one) for one in others))
        return applies(answers)

    async def _repeat(self, work: Callable[[], Awaitable[None]]) -> None:
        while True:
            try:
                await work()
            except Exception:
                log.exception("The other servers could not be watched")
            await asyncio.sleep(BEAT_S)


def applies(answers: Collection[bool | None]) -> bool:
    """Return whether clients are better off with another server than with one without a database.

    ``answers``: of the others, as ``ask_if_ready`` returns them. Where none comes, it is this
    server that is cut off.
    """
    return any(answers) or all(answer is None for answer in answers)
