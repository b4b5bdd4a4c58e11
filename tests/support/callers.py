"""What dials in, for tests: sockets by Channels' own communicator, and a clinic to dial in to."""

from __future__ import annotations

import asyncio
import json
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from functools import partial
from typing import Any, Self

from channels.testing import WebsocketCommunicator

from rehab.people.models import Clinic, Patient, User
from rehab.people.roles import Role
from rehab.sessions.live import runtime as runtimes
from rehab.sessions.live.orders import ChangeOrder
from rehab.sessions.live.protocol.frames import READ_NOW
from rehab.sessions.log import SessionEvent, Step
from rehab.sessions.models import TrainingSession
from rehab.sessions.services import SessionRequest, create_session
from rehab.sessions.setup.protocol_models import MeasureDefinition
from rehab.stations.models import Device, Station
from rehab.training.changes import ChangeKind
from rehab.training.goals import GoalRule
from rehab.training.phases import Phase, make_phase
from rehab.training.valences import CueGestures
from tests.support.tablets import approved
from tests.support.world import signed_in

PATIENCE_S = 10.0  # only a failing test waits so long
OWN_PAGE = "http://localhost:8000"

Message = dict[str, Any]


class HungUp(AssertionError):
    """The server closed the socket while the test waited for something else."""


async def turns(count: int = 20) -> None:
    """Let all that can go on without waiting go on."""
    for _ in range(count):
        await asyncio.sleep(0)


class Caller:
    """One socket, as a client has it. ``open_ones`` are hung up when the test ends."""

    open_ones: list[Caller] = []

    def __init__(
        self,
        path: str,
        *,
        token: str | None = None,
        user: User | None = None,
        headers: Iterable[tuple[bytes, bytes]] = (),
        origin: str | None = OWN_PAGE,
    ) -> None:
        from garry_site.asgi import application

        lines = list(headers)
        if b"host" not in dict(lines):
            lines.append((b"host", b"localhost:8000"))
        if token is not None:
            lines.append((b"authorization", f"Bearer {token}".encode()))
        if user is not None:
            lines.append((b"cookie", f"sessionid={sign_in(user)}".encode()))
        if origin is not None:
            lines.append((b"origin", origin.encode()))
        self.wire = WebsocketCommunicator(application, path, headers=lines)
        # As our servers do: what can be handled at once is, unless something waits before it.
        self._take: Callable[[str], bool] | None = None
        ours: Any = {READ_NOW: partial(setattr, self, "_take")}
        self.wire.scope["extensions"] = ours
        self.heard: list[Message] = []
        self.code: int | None = None

    async def dial(self) -> Self:
        """Open the socket; the server accepts before it looks who is there."""
        accepted, _ = await self.wire.connect()
        assert accepted
        self.open_ones.append(self)
        return self

    async def say(self, message: Message | list[Any] | str | bytes) -> None:
        """Send a frame: an object as JSON, text and bytes as they are."""
        if isinstance(message, bytes):
            await self.wire.send_input({"type": "websocket.receive", "bytes": message})
        else:
            text = message if isinstance(message, str) else json.dumps(message)
            if self._take is not None and self.wire.input_queue.empty() and self._take(text):
                return
            await self.wire.send_input({"type": "websocket.receive", "text": text})

    async def hear(self, kind: str | None = None) -> Message:
        """Return the next message, or the next one of a type."""
        async with asyncio.timeout(PATIENCE_S):
            while True:
                if self.code is not None:
                    raise HungUp(f"closed with {self.code} after {self.heard[-1:]}")
                message = self._note(await self.wire.output_queue.get())
                if message is not None and kind in (None, message["type"]):
                    return message

    def _note(self, output: Message) -> Message | None:
        if output["type"] == "websocket.close":
            self.code = output["code"]
            return None
        message: Message = json.loads(output["text"], parse_constant=refuse_constant)
        self.heard.append(message)
        return message

    async def overhear(self) -> list[Message]:
        """Return what has come without waiting for anything."""
        await turns()
        before = len(self.heard)
        while not self.wire.output_queue.empty():
            self._note(self.wire.output_queue.get_nowait())
        return self.heard[before:]

    async def acked(self, number: int) -> None:
        """Wait until steps up to this one are acknowledged."""
        while (await self.hear("ack"))["number"] < number:
            pass

    async def sent_away(self) -> tuple[int, Message]:
        """Wait until the server closes; return the code and the error it told."""
        async with asyncio.timeout(PATIENCE_S):
            while self.code is None:
                self._note(await self.wire.output_queue.get())
        errors = [message for message in self.heard if message["type"] == "error"]
        await self.hang_up()
        return self.code, errors[-1] if errors else {}

    async def hang_up(self) -> None:
        """Go, as a client that closes its socket, and wait until the server has let go."""
        if self in self.open_ones:
            self.open_ones.remove(self)
            await self.wire.disconnect(timeout=PATIENCE_S)


def refuse_constant(name: str) -> None:
    """Refuse what browsers cannot read: NaN and Infinity are no JSON."""
    raise AssertionError(f"the server sent {name}")


class SourceCaller(Caller):
    """A source of steps."""

    def __init__(self, token: str | None = None, **options: Any) -> None:
        super().__init__("/ws/source/", token=token, origin=None, **options)
        self.number = 0

    async def hello(self, **extra: Any) -> Message:
        """Say hello; return the welcome."""
        await self.say({"type": "hello", "version": 1, "run": "r1", "last": 0, **extra})
        welcome = await self.hear("welcome")
        if welcome["session"] is not None:
            self.number = welcome["next"] - 1
        return welcome

    async def open(self, **extra: Any) -> Self:
        """Dial in and say hello; return the source once it is welcome."""
        await (await self.dial()).hello(**extra)
        return self

    async def walk(self, *values: float | None, **extra: Any) -> None:
        """Send steps and wait until they are acknowledged."""
        for value in values:
            self.number += 1
            await self.say(a_step(self.number, value, **extra))
        await self.acked(self.number)


def a_step(number: int, value: Any = 4.0, **extra: Any) -> Message:
    """Return a step frame."""
    step = {"type": "step", "number": number, "time_s": number * 1.1, "side": "left"}
    return step | {"value": value} | extra


class Page(Caller):
    """A screen. It confirms each frame unless ``confirms`` is off."""

    confirms = True

    async def watch(self) -> Message:
        """Open it; return the snapshot."""
        await self.dial()
        return await self.hear("snapshot")

    async def open(self) -> Self:
        """Open it; return the page once it has its snapshot."""
        await self.watch()
        return self

    @property
    def events(self) -> list[Message]:
        """All events so far."""
        frames = [message for message in self.heard if message["type"] == "events"]
        return [event for frame in frames for event in frame["events"]]

    @property
    def steps(self) -> list[int]:
        """The numbers of all steps that came as events."""
        kinds = {"step", "missing", "calm"}
        return [event["number"] for event in self.events if event["kind"] in kinds]

    def last(self, kind: str) -> Message:
        """Return the latest event of a kind."""
        return [event for event in self.events if event["kind"] == kind][-1]

    async def overhear(self) -> list[Message]:
        """Return what has come without waiting for anything; confirm it."""
        before = len(self.heard)
        while frames := [m["frame"] for m in await super().overhear() if "frame" in m]:
            if not self.confirms:
                break
            await self.say({"type": "seen", "frame": frames[-1]})
        return self.heard[before:]

    async def until(self, is_there: Callable[[Message], bool]) -> Message:
        """Wait for an event that fits; return it."""
        looked = 0
        while True:
            for event in self.events[looked:]:
                if is_there(event):
                    return event
            looked = len(self.events)
            frame = await self.hear()
            if self.confirms and "frame" in frame:
                await self.say({"type": "seen", "frame": frame["frame"]})

    async def until_step(self, number: int) -> Message:
        """Wait for a step's event; return it."""
        return await self.until(lambda event: event.get("number") == number)


class PatientPage(Page):
    """The patient's page."""

    def __init__(self, session_id: int, query: str = "", **options: Any) -> None:
        super().__init__(f"/ws/session/{session_id}/patient/{query}", **options)


class MonitorPage(Page):
    """The PT's page."""

    def __init__(self, session_id: int, query: str = "", **options: Any) -> None:
        super().__init__(f"/ws/session/{session_id}/monitor/{query}", **options)

    async def change(self, kind: str, value: Any = None) -> Message:
        """Ask for a change; return the answer."""
        mark = f"m{len(self.heard)}"
        await self.say({"type": "change", "kind": kind, "value": value, "id": mark})
        while True:
            answer = await self.hear()
            if answer.get("id") == mark:
                return answer


class RobotCaller(Caller):
    """A robot."""

    def __init__(self, token: str | None = None, **options: Any) -> None:
        super().__init__("/ws/robot/", token=token, origin=None, **options)

    async def hello(self, **extra: Any) -> Message:
        """Say hello; return the welcome."""
        await self.say({"type": "hello", "version": 1, "base": "null"} | extra)
        return await self.hear("welcome")

    async def open(self, **extra: Any) -> Self:
        """Dial in and say hello; return the robot once it is welcome."""
        await (await self.dial()).hello(**extra)
        return self


_keys: dict[int, str] = {}


def sign_in(user: User) -> str:
    """Return the key of a signed-in person's browser session (made by ``build_place``)."""
    return _keys[user.pk]


def remember(place: Place) -> None:
    """Sign a place's people in by the keys that they have."""
    _keys.update(place.keys)


@dataclass
class Place:
    """A station with its devices, in a clinic with its people."""

    clinic: Clinic
    station: Station
    patient: Patient
    people: dict[Role, User]
    tokens: dict[str, str]
    devices: dict[str, Device]
    keys: dict[int, str]  # of their browser sessions, by the account

    @property
    def pt(self) -> User:
        """The clinic's PT."""
        return self.people[Role.PT]

    def source(self) -> SourceCaller:
        """Return the station's source."""
        return SourceCaller(self.tokens["source"])

    def robot(self) -> RobotCaller:
        """Return the station's robot."""
        return RobotCaller(self.tokens["robot"])

    def tablet(self, session: TrainingSession, query: str = "") -> PatientPage:
        """Return the station's tablet."""
        return PatientPage(session.pk, query, token=self.tokens["tablet"], origin=None)

    def monitor(self, session: TrainingSession, query: str = "") -> MonitorPage:
        """Return the PT's page."""
        return MonitorPage(session.pk, query, user=self.pt)


def build_place(name: str, clinic: Clinic | None = None, spares: int = 0) -> Place:
    """Build a station, in a new clinic unless one is given, with ``spares`` further sources."""
    clinic = clinic or Clinic.everywhere.create(name=name)
    people, keys = {}, {}
    for role in Role:
        home = None if role == Role.HOST else clinic
        user = User.everywhere.create_user(f"{role.value}-{name}", role=role, clinic=home)
        browser = signed_in(user)
        keys[user.pk] = browser.cookies["sessionid"].value
        people[role] = user
    station = Station.everywhere.create(clinic=clinic, name=name)
    patient = Patient.everywhere.create(
        clinic=clinic, code=f"code-{name}", nickname=f"nick-{name}", paretic_side="left"
    )
    tokens, devices = {}, {}
    kinds = ["source", "tablet", "robot", *(f"source {i}" for i in range(spares))]
    for kind in kinds:
        devices[kind], tokens[kind] = approved(station, kind, kind=kind.split()[0])
    place = Place(clinic, station, patient, people, tokens, devices, keys)
    remember(place)
    return place


def open_session(
    place: Place,
    *phases: Phase,
    valence: str = "binary",
    goal: GoalRule | None = None,
    at_station: bool = True,
    beside: bool = False,
    cue: CueGestures | None = None,
    measure: MeasureDefinition | None = None,
    **rules: Any,
) -> TrainingSession:
    """Make a session that is ready at the place's station.

    ``rules``: what else a `SessionRequest` says.

    ``beside`` puts it there though another one is open, as databases of before may have it.
    """
    session = create_session(
        SessionRequest(
            patient=place.patient,
            valence=valence,
            goal=goal or GoalRule(value=3.0),
            phases=phases or (make_phase("training"),),
            cue=cue,
            measure=measure,
            station=place.station if at_station and not beside else None,
            created_by=place.pt,
            **{"words_vary": False} | rules,
        )
    )
    if beside:
        session.station = place.station
        session.save(update_fields=["station"])
    return session


async def change(session: TrainingSession, kind: str, value: float | None = None) -> None:
    """Change a session as a page does; committed when this returns."""
    order = ChangeOrder(ChangeKind(kind), value, None)
    await runtimes.current().order(session.pk, order)


async def numbers(session: TrainingSession) -> list[int]:
    """Return the numbers of a session's stored steps."""
    return await rows_of(session, "number")


async def rows_of(session: TrainingSession, *columns: str) -> list[Any]:
    """Return columns of a session's stored steps, in their order."""
    steps = Step.everywhere.filter(session=session).order_by("number")
    return [row async for row in steps.values_list(*columns, flat=len(columns) == 1)]


async def events_of(session: TrainingSession, kind: str) -> list[SessionEvent]:
    """Return a session's stored events of a kind, in their order."""
    rows = SessionEvent.everywhere.filter(session=session, kind=kind).order_by("pk")
    return [row async for row in rows]


async def reread(session: TrainingSession) -> TrainingSession:
    """Return a session as it is stored now."""
    return await TrainingSession.everywhere.aget(pk=session.pk)


async def restart() -> None:
    """Let this server go and another one come."""
    runtime = runtimes.current()
    await runtime.drain()
    runtimes._current = None
