"""What sources and robots have in common: a token, a hello, a station and its sessions."""

from __future__ import annotations

from abc import abstractmethod
from typing import ClassVar

from django.utils import timezone

from rehab.sessions.live.auth import find_actor, find_device_by, may_open, open_session_of, token_of
from rehab.sessions.live.consumers.base import Closing, Socket
from rehab.sessions.live.owners import OwnedElsewhere
from rehab.sessions.live.session import LiveSession, Peer
from rehab.sessions.payloads import Message
from rehab.stations.models import Device
from rehab.training.changes import ENDED_STATES
from robot.wire.close_codes import CloseCode
from robot.wire.frames import BadFrame, read_object


class DeviceSocket(Socket):
    """The ``Peer`` of one device in its station's session.

    Subclasses say which ``kind`` of device they serve and which ``slot`` of a session it takes.
    """

    kind: ClassVar[Device.Kind]
    slot: ClassVar[str]
    device: Device | None = None
    said_hello = False

    @property
    def device_id(self) -> int | None:
        """Which device this is."""
        return None if self.device is None else self.device.pk

    async def opened(self) -> None:
        """Look at the token in the header, if there is one; wait for the first frame."""
        if token_of(self.scope) is not None:
            self._admit(await find_actor(self.scope))
        self._silence = self.start(self.refuse_silence())

    async def heard(self, text: str | None) -> None:
        """Deal with a frame; the first one brings the token where the header did not."""
        message = read_object(text)
        if self.device is None:
            token = message.get("token")
            self._admit(await find_device_by(token) if isinstance(token, str) else None)
        self._silence.cancel()
        await self.asked(message, text or "")

    def _admit(self, actor: object) -> Device:
        if not isinstance(actor, Device) or actor.kind != self.kind:
            raise Closing(
                CloseCode.UNAUTHORIZED,
                "token",
                f"This opens no {self.kind.value}. Take the {self.kind.value}'s token from the "
                'admin, and send it in the header "Authorization: Bearer …" or as "token" in the '
                "first frame.",
            )
        self.actor = self.device = actor
        return actor

    @abstractmethod
    async def asked(self, message: Message, text: str) -> None:
        """Deal with a message of an admitted device."""

    @abstractmethod
    async def attached(self, live: LiveSession) -> None:
        """Welcome the device to a session."""

    async def greet(self, session_id: int | None) -> None:
        """Take a hello: find the station's open session, or wait for one."""
        if self.said_hello:
            raise BadFrame("One hello a socket; connect again to begin anew.", "hello_again")
        self.said_hello = True
        self._silence.cancel()
        device = self._admit(self.device)
        self.runtime.waiting[device.station_id].add(self.session_opened)
        found = await open_session_of(device, session_id)
        if found is not None:
            await self._attach(found)
        elif session_id is not None and await may_open(device, session_id):
            raise Closing(
                CloseCode.ENDED,
                "ended",
                f"Session {session_id} has ended. Create a new one for this station.",
            )
        elif session_id is not None:
            raise Closing(
                CloseCode.NO_SESSION,
                "no_session",
                f"This station has no open session {session_id}. Create it.",
            )
        else:
            await self.say({"type": "welcome", "session": None})

    def session_opened(self, session_id: int) -> None:
        """Take up a session that has just been made for this station."""
        if self.live is None or self.live.actor.fold.state in ENDED_STATES:
            self.start(self._attach(session_id))

    async def _attach(self, session_id: int) -> None:
        try:
            # Admitted, too: from its place on until its welcome nothing may come between.
            live = await self.runtime.admitted(session_id)
        except OwnedElsewhere as problem:
            raise Closing(CloseCode.BUSY, "busy", str(problem)) from None
        other: Peer | None = getattr(live, self.slot)
        if other is not None and other is not self:
            if other.device_id != self.device_id:
                raise Closing(
                    CloseCode.BUSY,
                    "busy",
                    f"This session has another {self.kind.value}. Stop that one first, or use "
                    "another station.",
                )
            other.send_away(CloseCode.REPLACED, "replaced", "The same device connected again.")
        self._leave_session()
        self.live = live
        setattr(live, self.slot, self)
        live.announce_presence(timezone.now())
        await self.attached(live)

    def tell(self, message: Message) -> None:
        """Send the device a message soon."""
        self.outbox.tell(message)

    def acknowledge(self, number: int) -> None:
        """Tell the device that steps up to this one are on the disk."""
        self.outbox.acknowledge(number)

    def send_away(self, code: int, error: str, message: str) -> None:
        """Close soon, saying why."""
        self.start(self.end(code, error, message))

    def _leave_session(self) -> None:
        live, self.live = self.live, None
        if live is not None and getattr(live, self.slot) is self:
            setattr(live, self.slot, None)
            live.announce_presence(timezone.now())

    def left(self) -> None:
        """Free the session for another device."""
        if self.said_hello and self.device is not None:
            self.runtime.waiting[self.device.station_id].discard(self.session_opened)
        self._leave_session()
