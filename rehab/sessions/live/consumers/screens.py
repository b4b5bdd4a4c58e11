"""The sockets of pages: the patient's and the PT's."""

from __future__ import annotations

import asyncio
import re
from collections.abc import Awaitable
from typing import ClassVar
from urllib.parse import parse_qs

from channels.db import database_sync_to_async
from django.conf import settings
from django.utils import timezone
from django.utils.translation import override

from rehab.people.audit.audit_log import Act
from rehab.people.models import User
from rehab.people.roles import Role
from rehab.people.web.language import language_of
from rehab.people.web.refusals import format_refusal
from rehab.sessions.events import history_entry, to_text
from rehab.sessions.live.auth import Actor, find_actor, may_open, may_watch
from rehab.sessions.live.backlog import read_steps
from rehab.sessions.live.consumers.base import Closing, Socket
from rehab.sessions.live.hub import Lagged, Stalled, Subscriber
from rehab.sessions.live.messages import (
    read_change,
    read_order,
    read_remark,
)
from rehab.sessions.live.owners import OwnedElsewhere
from rehab.sessions.live.session import LiveSession, NotStored
from rehab.sessions.payloads import Message
from rehab.stations.models import Device
from rehab.training.changes import ChangeKind, PauseReason
from rehab.training.controls import CONTROLS, Audience, Requester
from rehab.training.measures import InvalidSetting
from robot.wire.close_codes import CloseCode
from robot.wire.frames import BadFrame, read_name, read_object, read_whole


class ScreenConsumer(Socket):
    """A page that watches a session. Subclasses say who may, and what they hear."""

    audience: ClassVar[Audience]
    people: ClassVar[frozenset[Role]] = frozenset({Role.LEAD, Role.PT})
    devices: ClassVar[frozenset[str]] = frozenset()
    requester: ClassVar[Requester]  # as whom people ask for changes here
    pauses_as: ClassVar[PauseReason]
    robot_orders: ClassVar[tuple[str, ...]] = ("stop",)
    subscriber: Subscriber | None = None
    language = settings.LANGUAGE_CODE

    async def opened(self) -> None:
        """Let the right people in and begin to send."""
        session_id = int(self.scope["url_route"]["kwargs"]["session_id"])
        self.actor = await find_actor(self.scope)
        if self.actor is None:
            raise Closing(
                CloseCode.UNAUTHORIZED, "sign_in", "Sign in again, or pair the tablet again."
            )
        if not self.is_welcome(self.actor) or not await may_open(self.actor, session_id):
            raise Closing(CloseCode.NO_SESSION, "no_session", "There is no such session for you.")
        if not await may_watch(self.actor, session_id, self.scope):
            raise Closing(
                CloseCode.NO_SESSION, "elsewhere", "The patient has not agreed to remote view."
            )
        try:
            self.live = live = await self.runtime.session(session_id)
        except OwnedElsewhere as problem:
            raise Closing(CloseCode.BUSY, "busy", str(problem)) from None
        if isinstance(self.actor, Device):
            live.tablets += 1
            live.tablet_heard_at = timezone.now()
        self.language = live.actor.fold.plan.language  # what the patient reads
        if self.audience is Audience.MONITOR and isinstance(self.actor, User):
            theirs = await database_sync_to_async(language_of)(self.actor)
            self.language = theirs or settings.LANGUAGE_CODE
        self.start(self._pump(live, _after(self.scope["query_string"])))
        self.runtime.notes.add(Act.VIEW, self.actor, session_id, self.scope, timezone.now())

    @classmethod
    def is_welcome(cls, actor: Actor) -> bool:
        """Whether actors of this kind may open such a page at all."""
        if isinstance(actor, User):
            return actor.role in cls.people
        return isinstance(actor, Device) and actor.kind in cls.devices

    async def _pump(self, live: LiveSession, after: int | None) -> None:
        """Send a snapshot, what was missed, then events; begin anew where the page lags."""
        while True:
            shown, subscriber = await live.join(self.audience, self.send, timezone.now())
            self.subscriber = subscriber
            if isinstance(self.actor, Device) or self.audience is Audience.MONITOR:
                live.announce_presence(timezone.now())
            try:
                await self.say(shown)
                if after is not None:
                    await self._send_missed(live, subscriber, after, shown["number"])
                subscriber.wake()
                await subscriber.pump()
            except Stalled:
                raise Closing(
                    CloseCode.UNCONFIRMED,
                    "unseen",
                    "The page confirms nothing. Connect again with ?after=.",
                ) from None
            except Lagged:
                after = None
            finally:
                live.feed.subscribers.discard(subscriber)

    async def _send_missed(
        self, live: LiveSession, subscriber: Subscriber, after: int, until: int
    ) -> None:
        """Send the steps after a number from the log, oldest first."""
        plan = live.actor.fold.plan
        while after < until:
            steps = await read_steps(live.id, after, until)
            if not steps:
                return
            entries = (history_entry(self.audience, plan, step) for step in steps)
            texts = [to_text(entry) for entry in entries if entry is not None]
            if texts:
                await subscriber.send_backlog(texts)
            after = steps[-1].number

    async def heard(self, text: str | None) -> None:
        """Deal with a confirmation."""
        await self.asked(read_object(text))

    async def asked(self, message: Message) -> None:
        """Deal with a confirmation or a change."""
        match message.get("type"):
            case "seen":
                if self.subscriber is not None:
                    self.subscriber.confirm(read_whole(message, "frame", low=0))
                if isinstance(self.actor, Device) and self.live is not None:
                    self.live.tablet_heard_at = timezone.now()
            case "change":
                await self._change(message)
            case "robot":
                await self._order_robot(message)
            case "remark":
                await self._remark(message)
            case _:
                raise BadFrame('A page sends "seen", "change", "remark" and "robot".')

    async def _change(self, message: Message) -> None:
        mark = read_name(message, "id")
        kind, value = read_change(message)
        if kind == ChangeKind.PAUSE:
            value = self.pauses_as.value
        live, by = self.live, self.actor if isinstance(self.actor, User) else None
        if live is None:
            raise Closing(
                CloseCode.NO_SESSION, "not_open", "The session is not open. Connect again."
            )
        if (self.requester if by else Requester.TABLET) not in CONTROLS[kind].requesters:
            await self._refuse(mark, "refused", "That is changed on the therapist's page.")
            return
        self.see_through(self._answer(mark, self.runtime.change(live.id, kind, value, by)))

    async def _remark(self, message: Message) -> None:
        mark = read_name(message, "id")
        what, value = read_remark(message)
        live, by = self.live, self.actor
        if live is None:
            raise Closing(
                CloseCode.NO_SESSION, "not_open", "The session is not open. Connect again."
            )
        if self.audience is not Audience.MONITOR or not isinstance(by, User):
            await self._refuse(mark, "refused", "That is noted on the therapist's page.")
            return
        self.see_through(self._answer(mark, self.runtime.remark(live.id, what, value, by)))

    async def _answer(self, mark: str, work: Awaitable[None]) -> None:
        """Say what became of something that was asked for, once it is stored or refused.

        Beside the socket, whose next frame may be a stop; and to its end if the page goes.
        """
        try:
            await work
        except InvalidSetting as problem:
            await self._refuse(mark, "refused", self._in_words(problem))
        except NotStored as problem:
            await self._refuse(mark, "not_stored", str(problem))
        else:
            await self.say({"type": "done", "id": mark})

    def _in_words(self, problem: InvalidSetting) -> str:
        """Say a refusal in the page's language."""
        with override(self.language):
            return format_refusal(problem)

    async def _order_robot(self, message: Message) -> None:
        """Stop the robot, whoever asks; let it move again where a person asks."""
        order = read_order(message, *self.robot_orders)
        live, by = self.live, self.actor if isinstance(self.actor, User) else None
        if live is None:
            raise Closing(
                CloseCode.NO_SESSION, "not_open", "The session is not open. Connect again."
            )
        sessions = self.runtime.at_station_of(live)
        if order == "stop":
            device = {"device": self.actor.pk} if isinstance(self.actor, Device) else {}
            for session in sessions:
                session.stop_robot(by, timezone.now(), device)
        elif by is not None:
            self.start(_until_stored([s.arm_robot(by, timezone.now()) for s in sessions]))
        if by is not None or order == "stop":  # beside the socket: no robot waits for the log
            act = Act(f"robot_{order}")
            self.runtime.notes.add(act, self.actor, live.id, self.scope, timezone.now())

    async def _refuse(self, mark: str, code: str, message: str) -> None:
        await self.say({"type": "error", "code": code, "id": mark, "message": message})

    def left(self) -> None:
        """Stop listening."""
        live, self.live = self.live, None
        if live is not None:
            if self.subscriber is not None:
                live.feed.subscribers.discard(self.subscriber)
            if isinstance(self.actor, Device):
                live.tablets -= 1
                live.announce_presence(timezone.now())


class PatientConsumer(ScreenConsumer):
    """The patient's page. Whoever walks may always rest; to go on is a person's decision."""

    audience = Audience.PATIENT
    devices = frozenset({Device.Kind.TABLET.value})
    requester = Requester.PATIENT_PAGE
    pauses_as = PauseReason.PATIENT


class MonitorConsumer(ScreenConsumer):
    """The PT's page: sees everything and steers."""

    audience = Audience.MONITOR
    requester = Requester.MONITOR
    pauses_as = PauseReason.THERAPIST
    robot_orders = ("stop", "arm")


async def _until_stored(futures: list[asyncio.Future[None]]) -> None:
    """Wait for commits beside the socket: a stop that is asked for meanwhile waits for none."""
    await asyncio.gather(*futures)


def _after(query: bytes) -> int | None:
    words = parse_qs(query.decode("latin-1")).get("after", [])
    return int(words[0]) if words and re.fullmatch("[0-9]{1,18}", words[0]) else None
