"""The base of sources and robots: a token, a hello, a station and its sessions."""

from __future__ import annotations

from abc import abstractmethod
from typing import ClassVar

from django.utils import timezone
from msgspec import to_builtins

from rehab.sessions.live.auth import (
    authenticate,
    authenticate_token,
    bearer_token,
    find_open_session,
    may_open,
    offer_successor,
    take_successor,
)
from rehab.sessions.live.consumers.base import CloseSocket, Socket
from rehab.sessions.live.devices import ConnectedDevice
from rehab.sessions.live.protocol.fields import PartOf
from rehab.sessions.live.protocol.messages import read_frame
from rehab.sessions.live.session.live_session import LiveSession
from rehab.sessions.state_messages import Message
from rehab.stations.models import Device
from rehab.training.changes import ENDED_STATES
from robot.wire.close_codes import CloseCode
from robot.wire.frames import BadFrame


class DeviceSocket(Socket):
    """The ``ConnectedDevice`` of one device in its station's session.

    Subclasses set the ``kind`` of device and the attribute (``slot``) of the session it takes.
    """

    kind: ClassVar[Device.Kind]
    slot: str
    device: Device | None = None
    hello_received = False
    plugin: PartOf | None = None  # that it is a part of
    simulated = False
    rotates = False  # it can store another token, and none is being given

    @property
    def device_id(self) -> int | None:
        """The device's key."""
        return None if self.device is None else self.device.pk

    async def on_connect(self) -> None:
        """Authenticate by the header's token, if there is one; wait for the first frame."""
        if bearer_token(self.scope) is not None:
            self._authorize(await authenticate(self.scope))
        self._first_frame_timer = self.start(self.enforce_first_frame())

    async def on_frame(self, text: str | None) -> None:
        """Handle a frame; without a token in the header the first one brings it."""
        message = read_frame(text)
        if self.device is None:
            token = message.get("token")
            known = isinstance(token, str) and await authenticate_token(token, self.scope)
            self._authorize(known or None)
        self._first_frame_timer.cancel()
        if message.get("type") == "token":
            await self._take_token(message.get("token"))
            return
        await self.on_message(message, text or "")
        if message.get("type") == "hello" and message.get("rotates") is True:
            self.rotates = True
            await self._offer_token()

    async def _offer_token(self) -> None:
        """Send the device its next token, if it is time and the device can store one."""
        if not self.rotates or self.device is None or self.device.given_hash:
            return
        self.rotates = False  # a second one would make the first one useless on its way
        token = await offer_successor(self.device, timezone.now())
        self.rotates = True
        if token is not None:
            await self.send_message({"type": "token", "token": token})

    async def _take_token(self, token: object) -> None:
        device = self._authorize(self.device)
        now = timezone.now()
        if not isinstance(token, str) or not await take_successor(device, token, self.scope, now):
            raise BadFrame("That is not the token that this device was given.", "token")

    def _authorize(self, actor: object) -> Device:
        if not isinstance(actor, Device) or actor.kind != self.kind:
            raise CloseSocket(
                CloseCode.UNAUTHORIZED,
                "token",
                f"This is no valid token of a {self.kind.value}. Take the {self.kind.value}'s "
                'token from the admin, and send it in the header "Authorization: Bearer …" or as '
                '"token" in the first frame.',
            )
        self.actor = self.device = actor
        return actor

    @abstractmethod
    async def on_message(self, message: Message, text: str) -> None:
        """Handle a message of an authenticated device."""

    @abstractmethod
    async def on_attach(self, live: LiveSession) -> None:
        """Send the welcome to a session."""

    async def join_station(self, session_id: int | None) -> None:
        """Attach the device to its station's open session, or wait for one."""
        if self.hello_received:
            raise BadFrame(
                "Send hello once per connection; reconnect to start over.", "hello_again"
            )
        self.hello_received = True
        self._first_frame_timer.cancel()
        device = self._authorize(self.device)
        self.belong_to(device.clinic_id)
        await self.runtime.clinics.own(device.clinic_id)
        self.runtime.devices.add(device.station_id, self)
        found = await find_open_session(device, session_id)
        if found is not None:
            await self._attach(found)
        elif session_id is not None and await may_open(device, session_id):
            raise CloseSocket(
                CloseCode.ENDED,
                "ended",
                f"Session {session_id} has ended. Create a new one for this station.",
            )
        elif session_id is not None:
            raise CloseSocket(
                CloseCode.NO_SESSION,
                "no_session",
                f"This station has no open session {session_id}. Create it.",
            )
        else:
            await self.send_message({"type": "welcome", "session": None})

    def on_session_opened(self, session_id: int) -> None:
        """Attach the device to a session that was just created for its station."""
        if self.live is None or self.live.aggregate.fold.state in ENDED_STATES:
            self.start(self._attach(session_id))
            self.start(self._offer_token())

    async def _attach(self, session_id: int) -> None:
        # Settled: nothing may come between taking the slot and the welcome.
        live = await self.runtime.settled_session(session_id)
        if not self.takes_part(live):
            self._leave_session()
            await self.send_message({"type": "welcome", "session": None})
            return
        slot = self.choose_slot(live)
        other: ConnectedDevice | None = getattr(live, slot)
        if other is not None and other is not self:
            if other.device_id != self.device_id:
                raise CloseSocket(
                    CloseCode.BUSY,
                    "busy",
                    f"This session has another {self.kind.value}. Stop that one first, or use "
                    "another station.",
                )
            other.evict(CloseCode.REPLACED, "replaced", "The same device connected again.")
        self._leave_session()
        self.live, self.slot = live, slot
        setattr(live, self.slot, self)
        live.announce_presence(timezone.now())
        if self.plugin is not None:
            live.note_plugin(to_builtins(self.plugin), timezone.now())
        await self.on_attach(live)

    def takes_part(self, live: LiveSession) -> bool:
        """Return whether the session's plan has a part for it."""
        return True

    def choose_slot(self, live: LiveSession) -> str:
        """Return which attribute of the session it takes."""
        return self.slot

    def evict(self, code: int, error: str, message: str) -> None:
        """Close soon, with an error."""
        self.start(self.close_with_error(code, error, message))

    def _leave_session(self) -> None:
        live, self.live = self.live, None
        if live is not None and getattr(live, self.slot) is self:
            setattr(live, self.slot, None)
            live.announce_presence(timezone.now())

    def on_disconnect(self) -> None:
        """Free the session's slot."""
        if self.hello_received and self.device is not None:
            self.runtime.devices.discard(self.device.station_id, self)
        self._leave_session()
