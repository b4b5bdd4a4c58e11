"""Sends nonsense to every socket of a clinic, beside somebody who walks.

Each socket is dialed, says some valid frames and then a noisy one. A last frame that no socket
takes brings an answer once all before it has been dealt with.
"""

from __future__ import annotations

import asyncio
import json
import time
from collections import Counter
from dataclasses import dataclass
from typing import Any

from asgiref.sync import sync_to_async
from hypothesis import strategies as st

from rehab.sessions.live import runtime as runtimes
from rehab.sessions.models import TrainingSession
from rehab.training.changes import ENDED_STATES, State
from robot.wire.incident import pack
from tests.support.api_noise import JUNK, JUNK_TEXTS
from tests.support.callers import (
    Caller,
    HungUp,
    Message,
    MonitorPage,
    Place,
    SourceCaller,
    a_step,
    build_place,
    change,
    open_session,
)
from tests.support.incidents import BUMPED
from tests.support.noise import TELLTALES, draw

STEP_S = 2.0  # in which a valid step is scored, stored and shown, whatever others send
LAST = "{"  # what no socket takes
BATCH = 8  # noisy frames, then a valid step beside them
# Codes of docs/protocol.md that noise may earn: never 4011, a failure of ours.
EARNED = {4001, 4004, 4008, 4009, 4029, 4400, 4409, 4410}

STATUS: Message = {"kind": "status", "base": "null", "state": "idle", "reason": ""}
STATUS |= {"gesture": None, "pose": {"x_m": 0, "y_m": 0.5, "heading_rad": 1}, "battery_v": 16.1}
DECISION: Message = {"kind": "decision", "from_s": 0, "until_s": 5, "mean": 1.0, "threshold": 0.9}
DECISION |= {"activated_share": 0.5, "steps": 4, "above": True, "reason": "", "intensity": 0.8}
GESTURE: Message = {"kind": "gesture", "name": "celebrate", "phase": "ended", "outcome": "done"}
GESTURE |= {"note": "kept as it came"}
INCIDENT: Message = {"type": "incident", "session": 0, "reason": "bump", "ago_s": 6.5}
INCIDENT |= {"recording": pack(BUMPED)}

HELLO: Message = {"type": "hello", "version": 1, "run": "r", "last": 0, "clock_s": 1.5, "speed": 1}
TEMPLATES: dict[str, list[Message]] = {
    "source": [
        HELLO,
        a_step(1, 4.0, reasons=["slip"], extra={"stance_s": 0.7}),
        {"type": "steps", "steps": [a_step(1), a_step(2, None)]},
    ],
    "robot": [
        {"type": "hello", "version": 1, "base": "null"},
        *({"type": "report", "report": report} for report in (STATUS, DECISION, GESTURE)),
        {"type": "report", "report": {"kind": "stop", "reason": "bump"}},
        INCIDENT,
    ],
    "tablet": [
        {"type": "seen", "frame": 1},
        {"type": "change", "kind": "pause", "value": None, "id": "c1"},
        {"type": "robot", "order": "stop"},
    ],
    "monitor": [
        {"type": "seen", "frame": 1},
        {"type": "change", "kind": "goal", "value": 3.5, "id": "c1"},
        {"type": "change", "kind": "resume", "id": "c2"},
        {"type": "change", "kind": "phase", "value": 0, "id": "c3"},
        {"type": "remark", "what": "borg", "value": 4, "id": "c4"},
        {"type": "robot", "order": "arm"},
    ],
}


@dataclass(frozen=True)
class Noise:
    """What one socket sends: valid frames by their index, then a noisy one."""

    socket: str
    greets: bool
    valid: list[int]
    frame: str | bytes


def make_noise() -> st.SearchStrategy[Noise]:
    """Return a strategy of what a socket sends."""
    texts = st.sampled_from(JUNK_TEXTS) | st.text(max_size=20)
    plain = st.sampled_from([*JUNK, float("nan"), float("inf")]) | texts | st.floats()
    junk = st.recursive(
        plain, lambda inner: st.lists(inner, max_size=3) | st.dictionaries(texts, inner, max_size=3)
    )
    depth = st.sampled_from([9, 100, 5_000, 100_000])
    raw = st.one_of(
        st.binary(max_size=80),
        texts,
        junk.map(json.dumps),
        depth.map(lambda n: "[" * n),
        depth.map(lambda n: '{"a":' * n + "1" + "}" * n),
        st.sampled_from([65_536, 65_537, 1_000_000]).map(lambda n: '{"type":"' + "x" * n + '"}'),
        st.sampled_from(
            ["NaN, NaN", "4.2, 3.0", "4.2,", ",", "1e400, 1", "٣, ٣", "-inf, 4", "4,4,4"]
        ),
    )

    @st.composite
    def altered(draw_one: Any, socket: str) -> str:
        """Return a valid message with parts put out of shape, at any depth."""
        message = json.loads(json.dumps(draw_one(st.sampled_from(TEMPLATES[socket]))))
        for _ in range(draw_one(st.integers(1, 3))):
            inside: Any = message
            while isinstance(inside, dict) and inside:
                name = draw_one(st.sampled_from(sorted(inside)))
                deeper = inside[name]
                if isinstance(deeper, dict) and draw_one(st.booleans()):
                    inside = deeper
                    continue
                match draw_one(st.sampled_from(["change", "change", "drop", "add"])):
                    case "change":
                        inside[name] = draw_one(junk)
                    case "drop":
                        del inside[name]
                    case "add":
                        inside[draw_one(texts)] = draw_one(junk)
                break
        text = json.dumps(message)
        return text[: draw_one(st.integers(0, len(text)))] if draw_one(NOW_AND_THEN) else text

    @st.composite
    def noise(draw_one: Any) -> Noise:
        socket = draw_one(st.sampled_from(sorted(TEMPLATES)))
        valid = draw_one(st.lists(st.integers(0, 9), max_size=3))
        frame = draw_one(st.one_of(raw, altered(socket), altered(socket)))
        return Noise(socket, draw_one(st.integers(0, 7)) > 0, valid, frame)

    return noise()


NOW_AND_THEN = st.integers(0, 9).map(lambda number: number == 0)


class Ward:
    """Somebody who walks at one station, and noise at another."""

    def __init__(
        self, noisy: Place, session: TrainingSession, source: SourceCaller, page: MonitorPage
    ) -> None:
        self.noisy, self.session = noisy, session
        self.source, self.page = source, page
        self.codes: Counter[int] = Counter()
        self.slowest_s = 0.0

    @classmethod
    async def build(cls) -> Ward:
        """Open sessions, one in a clinic that is nobody's business, and begin to walk."""
        good = await sync_to_async(build_place)("ash")
        noisy = await sync_to_async(build_place)("oak", good.clinic)
        walked, _, session = [
            await begin(place)
            for place in (good, await sync_to_async(build_place)("foreignfir"), noisy)
        ]
        source, page = await good.source().dial(), good.monitor(walked)
        await source.hello()
        await page.watch()
        return cls(noisy, session, source, page)

    async def send(self, noise: Noise) -> None:
        """Dial in, say all of it, and look at every answer."""
        caller = self._caller(noise)
        await caller.dial()
        if noise.socket in ("source", "robot"):
            if noise.greets:
                await caller.say(TEMPLATES[noise.socket][0])
        else:
            await caller.hear("snapshot")
        next_number = (await self._live()).next_number
        for index in noise.valid:
            message = dict(TEMPLATES[noise.socket][index % len(TEMPLATES[noise.socket])])
            if message["type"] == "step":
                message["number"], next_number = next_number, next_number + 1
            if message["type"] == "incident":
                message["session"] = self.session.pk
            if message["type"] != "hello":
                await caller.say(message)
        frame = noise.frame
        if isinstance(frame, str):
            frame = frame.replace('"session": 0', f'"session": {self.session.pk}')
        await caller.say(frame)
        await caller.say(LAST)
        code, error = await caller.sent_away()
        self.codes[code] += 1
        assert code in EARNED, (noise, code, error)
        assert error.get("message"), (noise, code)
        told = json.dumps(caller.heard).encode()
        assert not any(word in told for word in TELLTALES), noise
        assert b"foreignfir" not in told, noise

    def _caller(self, noise: Noise) -> Caller:
        place = self.noisy
        match noise.socket:
            case "source":
                return place.source()
            case "robot":
                return place.robot()
            case "tablet":
                return place.tablet(self.session)
        return place.monitor(self.session)

    async def _live(self) -> Any:
        live = await runtimes.current().session(self.session.pk)
        if live.aggregate.fold.state in ENDED_STATES:  # some noise is a valid change
            self.session = await begin(self.noisy)
            live = await runtimes.current().session(self.session.pk)
        elif live.aggregate.fold.state is State.PAUSED:
            await change(self.session, "resume")
        return live

    async def hold_out(self, noises: list[Noise]) -> None:
        """Send noise, and walk a step beside it now and then. Fails at the first that does harm."""
        for first in range(0, len(noises), BATCH):
            for noise in noises[first : first + BATCH]:
                try:
                    await self.send(noise)
                except (HungUp, TimeoutError) as problem:
                    raise AssertionError(noise) from problem
            await self.walk()
            await self.look()

    def tell(self) -> str:
        """Return what came of it."""
        codes = ", ".join(f"{code}: {number}" for code, number in sorted(self.codes.items()))
        return (
            f"{self.codes.total()} noisy frames ({codes}), "
            f"slowest valid step {1000 * self.slowest_s:.0f} ms"
        )

    async def walk(self) -> None:
        """Walk a step beside all that; it is scored and shown as ever."""
        number, began = self.source.number + 1, time.perf_counter()
        await self.source.walk(4.0)
        event = await self.page.until_step(number)
        self.slowest_s = max(self.slowest_s, time.perf_counter() - began)
        assert event["hit"] is True
        assert self.slowest_s < STEP_S

    async def look(self) -> None:
        """Look that nothing of the noise is left behind."""
        runtime = runtimes.current()
        async with asyncio.timeout(STEP_S):
            while len(runtime.sockets) > 2:  # noqa: ASYNC110 (the source and the page that stay)
                await asyncio.sleep(0)
        noisy = runtime.sessions.get(self.session.pk)
        assert noisy is None or not (noisy.feed.subscribers or noisy.source or noisy.robot)
        assert not runtime.devices.at(self.noisy.station.pk)


async def begin(place: Place) -> TrainingSession:
    """Start a session at a place."""
    session = await sync_to_async(open_session)(place)
    await change(session, "start")
    return session


async def run_noise(count: int) -> str:
    """Send so many noisy frames; fail at the first that does harm."""
    ward = await Ward.build()
    await ward.hold_out(draw(make_noise(), count))
    return ward.tell()
