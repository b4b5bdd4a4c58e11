"""The sockets of pages: the patient's and the PT's."""

from __future__ import annotations

from collections.abc import Awaitable
from typing import ClassVar

from channels.db import database_sync_to_async
from django.conf import settings
from django.utils import timezone
from django.utils.translation import override

from rehab.people.audit.audit_log import Act
from rehab.people.models import User
from rehab.people.roles import Role
from rehab.people.web.language import language_of
from rehab.people.web.refusals import format_refusal
from rehab.sessions.events.event import to_text
from rehab.sessions.events.snapshot import history_entry
from rehab.sessions.live.auth import Actor, authenticate, may_open, may_watch
from rehab.sessions.live.consumers.base import CloseSocket, Socket
from rehab.sessions.live.database.trouble import NotStored
from rehab.sessions.live.orders import ChangeOrder, Order, RemarkOrder
from rehab.sessions.live.protocol.messages import (
    is_mirror,
    read_after,
    read_change,
    read_frame,
    read_remark,
    read_seen,
)
from rehab.sessions.live.protocol.past_steps import read_backlog
from rehab.sessions.live.robot_permissions import RobotOrder, read_robot_order
from rehab.sessions.live.session.live_session import LiveSession
from rehab.sessions.live.session.subscribers import Lagged, Stalled, Subscriber
from rehab.sessions.state_messages import Message
from rehab.stations.models import Device
from rehab.training.changes import ChangeKind, NotAllowed, PauseReason
from rehab.training.controls import CONTROLS, Audience, Requester
from rehab.training.measures import InvalidSetting
from robot.wire.close_codes import CloseCode
from robot.wire.frames import BadFrame, read_flag, read_name, read_number, read_whole


class ScreenConsumer(Socket):
    """A page that subscribes to a session. Subclasses set who may, and what they get."""

    audience: ClassVar[Audience]
    people: ClassVar[frozenset[Role]] = frozenset({Role.LEAD, Role.PT})
    devices: ClassVar[frozenset[str]] = frozenset()
    requester: ClassVar[Requester]  # of changes, for people who are signed in
    pause_reason: ClassVar[PauseReason]
    subscriber: Subscriber | None = None
    language = settings.LANGUAGE_CODE

    async def on_connect(self) -> None:
        """Authorize the client and begin to send."""
        session_id = int(self.scope["url_route"]["kwargs"]["session_id"])
        self.actor = await authenticate(self.scope)
        if self.actor is None:
            raise CloseSocket(
                CloseCode.UNAUTHORIZED, "sign_in", "Sign in again, or pair the tablet again."
            )
        if not self.is_allowed(self.actor) or not await may_open(self.actor, session_id):
            raise CloseSocket(
                CloseCode.NO_SESSION, "no_session", "There is no such session for you."
            )
        if not await may_watch(self.actor, session_id, self.scope):
            raise CloseSocket(
                CloseCode.NO_SESSION, "elsewhere", "The patient has not agreed to remote view."
            )
        live = await self.runtime.session(session_id)
        self.belong_to(live.clinic_id)
        self.live = live
        if self.is_seen_by_patient:
            live.tablets += 1
            live.tablet_seen_at = timezone.now()
        self.language = live.aggregate.fold.valences.language  # what the patient reads
        if self.audience is Audience.MONITOR and isinstance(self.actor, User):
            theirs = await database_sync_to_async(language_of)(self.actor)
            self.language = theirs or settings.LANGUAGE_CODE
        self.start(self._pump(live, read_after(self.scope["query_string"])))
        self.runtime.audit_queue.add(Act.VIEW, self.actor, session_id, self.scope, timezone.now())

    @property
    def is_seen_by_patient(self) -> bool:
        """Whether it is the page that a patient looks at: on a tablet, or where one is signed in.

        A therapist's page has a copy of it (`mirror`).
        """
        return self.audience is Audience.PATIENT and not is_mirror(self.scope["query_string"])

    @classmethod
    def is_allowed(cls, actor: Actor) -> bool:
        """Whether actors of this kind may open such a page at all."""
        if isinstance(actor, User):
            return actor.role in cls.people
        return isinstance(actor, Device) and actor.kind in cls.devices

    async def _pump(self, live: LiveSession, after: int | None) -> None:
        """Send a snapshot, missed steps, then events; start again if the page lags."""
        while True:
            snapshot, subscriber = await live.subscribe(
                self.audience, self.send, timezone.now(), self.write
            )
            self.subscriber = subscriber
            if self.is_seen_by_patient or self.audience is Audience.MONITOR:
                live.announce_presence(timezone.now())
            try:
                await self.send_message(snapshot)
                if after is not None:
                    await self._send_missed(live, subscriber, after, snapshot["number"])
                subscriber.wake()
                await subscriber.pump()
            except Stalled:
                raise CloseSocket(
                    CloseCode.UNCONFIRMED,
                    "unseen",
                    "The page does not confirm its frames. Reconnect with ?after=.",
                ) from None
            except Lagged:
                after = None
            finally:
                live.feed.subscribers.discard(subscriber)

    async def _send_missed(
        self, live: LiveSession, subscriber: Subscriber, after: int, until: int
    ) -> None:
        """Send the steps after a number from the log, oldest first."""
        plan, announced = live.aggregate.fold.plan, tuple(live.aggregate.fold.delivery.reported)
        while after < until:
            steps = await read_backlog(live.id, after, until)
            if not steps:
                return
            entries = (history_entry(self.audience, plan, step, announced) for step in steps)
            texts = [to_text(entry) for entry in entries if entry is not None]
            if texts:
                await subscriber.send_backlog(texts)
            after = steps[-1].number

    def handle_now(self, text: str) -> bool:
        """Note what the page confirms, as most frames do; all else takes its turn."""
        frame = read_seen(text)
        if frame is not None:
            self._confirm(frame)
        return frame is not None

    def _confirm(self, frame: int) -> None:
        if self.subscriber is not None:
            self.subscriber.confirm(frame)
        if self.is_seen_by_patient and self.live is not None:
            self.live.tablet_seen_at = timezone.now()

    async def on_frame(self, text: str | None) -> None:
        """Handle a frame of a page."""
        await self.on_message(read_frame(text))

    async def on_message(self, message: Message) -> None:
        """Handle a message of a page."""
        match message.get("type"):
            case "seen":
                self._confirm(read_whole(message, "frame", low=0))
            case "change":
                await self._change(message)
            case "robot":
                await self._order_robot(message)
            case "remark":
                await self._remark(message)
            case _:
                raise BadFrame('A page sends "seen", "change", "remark" and "robot".')

    def _open_session(self) -> LiveSession:
        if self.live is None:
            raise CloseSocket(
                CloseCode.NO_SESSION, "not_open", "The session is not open. Connect again."
            )
        return self.live

    async def _change(self, message: Message) -> None:
        request_id = read_name(message, "id")
        kind, value = read_change(message)
        if kind == ChangeKind.PAUSE:
            value = self.pause_reason.value
        live, by = self._open_session(), self.actor if isinstance(self.actor, User) else None
        if (self.requester if by else Requester.TABLET) not in CONTROLS[kind].requesters:
            await self._refuse(request_id, "refused", "That is changed on the therapist's page.")
            return
        self._order(request_id, live, ChangeOrder(kind, value, by))

    async def _remark(self, message: Message) -> None:
        request_id = read_name(message, "id")
        what, value = read_remark(message)
        live, by = self._open_session(), self.actor
        if self.audience is not Audience.MONITOR or not isinstance(by, User):
            await self._refuse(request_id, "refused", "That is noted on the therapist's page.")
            return
        self._order(request_id, live, RemarkOrder(what, value, by))

    def _order(self, request_id: str, live: LiveSession, order: Order) -> None:
        """Have an order carried out beside the socket, whose next frame may be a stop.

        It is carried out to its end even if the page closes.
        """
        self.run_to_end(self._answer(request_id, self.runtime.order(live.id, order)))

    async def _answer(self, request_id: str, work: Awaitable[None]) -> None:
        """Answer a request once it is stored or refused."""
        try:
            await work
        except InvalidSetting as problem:
            await self._refuse(request_id, "refused", self._format_refusal(problem))
        except NotStored as problem:
            await self._refuse(request_id, "not_stored", str(problem))
        else:
            await self.send_message({"type": "done", "id": request_id})

    def _format_refusal(self, problem: InvalidSetting) -> str:
        """Return a refusal in the page's language."""
        with override(self.language):
            return format_refusal(problem)

    async def _order_robot(self, message: Message) -> None:
        """Stop the robot, let it move again, or drive it to its mark."""
        wanted = read_robot_order(message, self.audience, self.actor)
        if wanted is RobotOrder.DRIVE:
            self._drive_robot(message)
            return
        live, actor = self._open_session(), self.actor
        if wanted is RobotOrder.ARM and isinstance(actor, User):
            try:
                self.runtime.robots.check_arm(live)
            except NotAllowed as problem:
                await self._refuse("", "refused", self._format_refusal(problem))
                return
            # In a task, so that a stop meanwhile does not wait.
            self.start(self.runtime.robots.arm(live, actor))
        else:
            person = actor if isinstance(actor, User) else None
            device = {"device": actor.pk} if isinstance(actor, Device) else {}
            self.runtime.robots.stop(live, person, device)
        # Queued: no robot waits for the audit log.
        act = Act(f"robot_{wanted}")
        self.runtime.audit_queue.add(act, self.actor, live.id, self.scope, timezone.now())

    def _drive_robot(self, message: Message) -> None:
        """Pass on that a person holds a button to drive the robot to its mark."""
        shares = {"ahead": (0, 1), "left": (-1, 1)}
        drive: Message = {name: read_number(message, name, *ends) for name, ends in shares.items()}
        if read_flag(message, "home"):
            drive["home"] = True
        if self.live is not None and self.runtime.may_move_robots:
            self.runtime.robots.drive(self.live.id, drive)

    async def _refuse(self, request_id: str, code: str, message: str) -> None:
        await self.send_message(
            {"type": "error", "code": code, "id": request_id, "message": message}
        )

    def on_disconnect(self) -> None:
        """Unsubscribe."""
        live, self.live = self.live, None
        if live is not None:
            if self.subscriber is not None:
                live.feed.subscribers.discard(self.subscriber)
            if self.is_seen_by_patient:
                live.tablets -= 1
                live.announce_presence(timezone.now())


class PatientConsumer(ScreenConsumer):
    """The patient's page. The tablet alone can pause; to resume takes a signed-in person."""

    audience = Audience.PATIENT
    devices = frozenset({Device.Kind.TABLET.value})
    requester = Requester.PATIENT_PAGE
    pause_reason = PauseReason.PATIENT


class MonitorConsumer(ScreenConsumer):
    """The PT's page: gets every event and requests changes."""

    audience = Audience.MONITOR
    requester = Requester.MONITOR
    pause_reason = PauseReason.THERAPIST
