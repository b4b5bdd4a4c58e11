"""A state machine of sources and their connections, and the plain list that the log should be."""

from __future__ import annotations

import asyncio
import os
import socket
import threading
from typing import Any

from asgiref.sync import sync_to_async
from django.db import connections
from hypothesis import strategies as st
from hypothesis.stateful import (
    RuleBasedStateMachine,
    initialize,
    invariant,
    precondition,
    rule,
)

from rehab.sessions.live import runtime as runtimes
from rehab.sessions.live.session.aggregate import SessionAggregate
from rehab.sessions.log import Step
from rehab.sessions.log_fold import log_entries
from rehab.sessions.models import TrainingSession
from rehab.training.changes import Change, ChangeKind, PauseReason
from rehab.training.fold import SessionFold
from rehab.training.phases import make_phase
from rehab.training.steps import Measurement, Side
from tests.support import callers
from tests.support.callers import (
    Caller,
    Place,
    SourceCaller,
    a_step,
    change,
    open_session,
    turns,
)
from tests.support.folds import fold_log
from tests.support.power_switch import PowerSwitch
from tests.support.world import set_owner

PHASES = (make_phase("training", strides=5), make_phase("catch", strides=3), make_phase("training"))
VALUES = st.sampled_from([None, 2.0, 3.0, 4.5, 99.0])
SIDES = st.sampled_from(["left", "left", "right"])


class Sources(RuleBasedStateMachine):
    """A source that keeps what is not acknowledged, as the protocol asks, and all that befalls it.

    ``made`` are the steps it has made, in order; ``log`` is the oracle: what the session's log
    must hold in the end, steps and changes in the order in which they took effect.
    """

    place: Place
    switch: PowerSwitch

    def __init__(self) -> None:
        super().__init__()
        self.loop = asyncio.new_event_loop()
        self.source: SourceCaller | None = None
        self.made: list[dict[str, Any]] = []
        self.log: list[Measurement | Change] = []
        self.state = "ready"
        self.run = 0
        self.acked = 0
        self.stalled = False

    def go(self, work: Any) -> Any:
        return self.loop.run_until_complete(work)

    @property
    def sent(self) -> int:
        """How many steps the server has taken."""
        return sum(isinstance(entry, Measurement) for entry in self.log)

    @initialize()
    def begin(self) -> None:
        async def begin() -> None:
            # A session that another example left open would be the station's, too.
            left = TrainingSession.everywhere.filter(station=self.place.station)
            await left.aupdate(state="aborted")
            self.session = await sync_to_async(open_session)(self.place, *PHASES)
            await self._connect()
            await self._change("start")

        self.go(begin())

    # --- what the source does ---------------------------------------------------------------------

    async def _connect(self) -> None:
        """Connect, and send again what the server wants and the source still has."""
        self.source = await self.place.source().dial()
        welcome = await self.source.hello(run=f"r{self.run}", last=len(self.made), speed=None)
        assert welcome["session"] == self.session.pk
        assert self.acked < welcome["next"] <= len(self.made) + 1
        assert welcome["next"] == self.sent + 1
        if self.state != "ready":
            for step in self.made[welcome["next"] - 1 :]:
                await self._send(step)

    async def _send(self, *steps: dict[str, Any]) -> None:
        frame = steps[0] if len(steps) == 1 else {"type": "steps", "steps": list(steps)}
        await self.source.say(frame)
        for step in steps:
            entry = Measurement(step["number"], step["time_s"], Side(step["side"]), step["value"])
            if entry.number == self.sent + 1:
                self.log.append(entry)
        await turns(5)

    def _make(self, value: float | None, side: str) -> dict[str, Any]:
        step = a_step(len(self.made) + 1, value, side=side)
        self.made.append(step)
        return step

    @precondition(lambda self: self.source)
    @rule(steps=st.lists(st.tuples(VALUES, SIDES), min_size=1, max_size=4))
    def walk(self, steps: list[tuple[float | None, str]]) -> None:
        self.go(self._send(*[self._make(*step) for step in steps]))

    @rule(value=VALUES, side=SIDES)
    def walk_into_the_void(self, value: float | None, side: str) -> None:
        """The step is made, and its frame is lost with the connection."""
        if self.source is not None:
            self.drop()
        self._make(value, side)

    # A step that is still on its way to the disk is compared once it is there: its socket waits.
    @precondition(lambda self: self.source and self.made and not self.stalled)
    @rule(data=st.data())
    def repeat(self, data: st.DataObject) -> None:
        first = data.draw(st.integers(0, len(self.made) - 1))
        last = data.draw(st.integers(first, min(first + 3, len(self.made) - 1)))

        async def repeat() -> None:
            live = await runtimes.current().session(self.session.pk)
            await live.wait_until_committed()
            await self.source.overhear()
            known = max(0, min(last + 1, self.sent) - first)
            await self._send(*self.made[first : last + 1])
            for _ in range(known):  # each is compared in the database before the next frame is read
                await self.source.hear("ack")

        self.go(repeat())

    @precondition(lambda self: self.source)
    @rule(jump=st.integers(1, 3))
    def reorder(self, jump: int) -> None:
        """A later step overtakes: nothing of it is taken, and the source begins again."""

        async def reorder() -> None:
            await self.source.say(a_step(self.sent + 1 + jump))
            code, error = await self._sent_away()
            assert (code, error["code"]) == (4400, "gap")

        self.go(reorder())

    @precondition(lambda self: self.source and self.sent and not self.stalled)
    @rule(data=st.data())
    def contradict(self, data: st.DataObject) -> None:
        number = data.draw(st.integers(1, self.sent))

        async def contradict() -> None:
            await self.source.say(a_step(number, 1.25))
            code, error = await self._sent_away()
            assert (code, error["code"]) == (4400, "conflict")

        self.go(contradict())

    @precondition(lambda self: self.source)
    @rule()
    def drop(self) -> None:
        async def drop() -> None:
            await self.source.overhear()
            self._note_acks()
            await self.source.hang_up()
            self.source = None

        self.go(drop())

    @precondition(lambda self: self.source is None)
    @rule()
    def connect(self) -> None:
        self.go(self._connect())

    @precondition(lambda self: self.source)
    @rule()
    def connect_twice(self) -> None:
        """The old connection hangs; the new one takes over."""

        async def connect() -> None:
            old = self.source
            await self._connect()
            code, _ = await old.sent_away()
            assert code == 4009

        self.go(connect())

    @precondition(lambda self: self.source is None)
    @rule()
    def restart(self) -> None:
        """The source begins anew: what it had kept is gone, and it counts on from ``next``."""
        self.run += 1
        del self.made[self.sent :]
        self.connect()

    # --- what others do ---------------------------------------------------------------------------

    async def _change(self, kind: str, value: float | None = None) -> None:
        await change(self.session, kind, value)
        self.log.append(Change(ChangeKind(kind), value))
        self.state = {"start": "running", "resume": "running", "pause": "paused"}.get(
            kind, self.state
        )

    @precondition(lambda self: not self.stalled)
    @rule(goal=st.sampled_from([2.5, 3.5]))
    def set_goal(self, goal: float) -> None:
        self.go(self._change("goal", goal))

    @precondition(lambda self: not self.stalled)
    @rule()
    def pause_or_resume(self) -> None:
        self.go(self._change("pause" if self.state == "running" else "resume"))

    @precondition(lambda self: not self.stalled)
    @rule(index=st.integers(0, 2))
    def set_phase(self, index: int) -> None:
        self.go(self._change("phase", index))

    @rule()
    def let_the_disk_stall_or_go_on(self) -> None:
        if not self.stalled:
            self.go(self._catch_up())
        self.stalled = not self.stalled
        (self.switch.open.clear if self.stalled else self.switch.open.set)()

    @rule()
    def crash(self) -> None:
        """The power goes: no drain, no farewell; what was not committed is gone."""
        self.go(self._crash())

    @precondition(lambda self: self.source and not self.stalled)
    @rule(steps=st.lists(st.tuples(VALUES, SIDES), min_size=1, max_size=3))
    def freeze(self, steps: list[tuple[float | None, str]]) -> None:
        """The process freezes with steps on their way, another takes the session over, and then
        the first one goes on: what it had queued may not come into the log any more.
        """
        self.go(self._freeze(steps))

    async def _freeze(self, steps: list[tuple[float | None, str]]) -> None:
        await self._catch_up()
        frozen, kept = runtimes.current(), self.sent
        thaw = self.switch.frozen.setdefault(frozen.writer, threading.Event())
        await self._send(*[self._make(*step) for step in steps])
        await self.source.overhear()
        self._note_acks()
        runtimes._current = None
        try:
            await self._lose_all_but(kept)
            await runtimes.current().session(self.session.pk)  # a paused one is taken over so
        finally:  # whatever fault was found: its writer waits, and Python would wait for it
            thaw.set()
            await self._end(frozen)

    async def _catch_up(self) -> None:
        """Let the server finish, so that what a crash takes along is no matter of timing."""
        live = runtimes.current().sessions.get(self.session.pk)
        if live is not None:
            async with asyncio.timeout(callers.PATIENCE_S):
                while live.next_number <= self.sent:  # noqa: ASYNC110
                    await asyncio.sleep(0)
                await live.wait_until_committed()

    async def _crash(self) -> None:
        runtime = runtimes.current()
        if self.source is not None:
            await self.source.overhear()
            self._note_acks()
        if not self.stalled:
            await self._catch_up()
        self.switch.dead.add(runtime.writer)
        self.switch.open.set()
        self.stalled = False
        await self._end(runtime)
        await self._lose_all_but(await Step.everywhere.filter(session=self.session).acount())

    async def _lose_all_but(self, kept: int) -> None:
        """Have a new process take over what the one before has stored."""
        assert self.acked <= kept <= self.sent  # nothing acknowledged is lost
        while self.sent > kept:
            assert isinstance(self.log.pop(), Measurement)
        ended = f"{socket.gethostname()}|{os.getpid()}|0"  # a process that is no more
        await sync_to_async(set_owner)(self.session.clinic_id, ended)
        assert await runtimes.current().recover() == (self.state == "running")
        if self.state == "running":
            self.log.append(Change(ChangeKind.PAUSE, PauseReason.RESTART))
            self.state = "paused"

    async def _end(self, runtime: runtimes.Runtime) -> None:
        await runtime.loop.run_in_executor(None, runtime.writer.close)
        for routine in runtime.routines.tasks:
            routine.cancel()
        for caller in list(Caller.open_ones):
            await caller.hang_up()
        self.source = None
        if runtimes._current is runtime:
            runtimes._current = None

    async def _sent_away(self) -> tuple[int, dict[str, Any]]:
        source, self.source = self.source, None
        answer = await source.sent_away()
        self._note_acks(source)
        return answer

    def _note_acks(self, source: SourceCaller | None = None) -> None:
        heard = (source or self.source).heard
        numbers = [message["number"] for message in heard if message["type"] == "ack"]
        assert numbers == sorted(numbers)
        self.acked = max([self.acked, *numbers])

    # --- what must hold ---------------------------------------------------------------------------

    @invariant()
    def the_source_is_still_welcome(self) -> None:
        assert self.source is None or self.source.code is None

    def teardown(self) -> None:
        try:
            if hasattr(self, "session"):
                self.go(self._look_at_the_log())
        finally:
            self.switch.release()
            self.go(self._clean())
            self.loop.run_until_complete(self.loop.shutdown_default_executor())
            self.loop.close()

    async def _look_at_the_log(self) -> None:
        self.switch.open.set()
        if self.source is None:
            await self._connect()
        for step in self.made[self.sent :]:
            await self._send(step)
        live = await runtimes.current().session(self.session.pk)
        async with asyncio.timeout(callers.PATIENCE_S):
            while live.next_number <= len(self.made):  # noqa: ASYNC110
                await asyncio.sleep(0)
            await live.wait_until_committed()
        assert self.sent == len(self.made)
        await sync_to_async(self._compare)(live.aggregate)

    def _compare(self, actor: SessionAggregate) -> None:
        session = TrainingSession.everywhere.get(pk=self.session.pk)
        numbers = Step.everywhere.filter(session=session).order_by("number")
        assert list(numbers.values_list("number", flat=True)) == list(range(1, self.sent + 1))
        # The log in its order, but for what the server found wrong with a step.
        assert [plain(entry) for entry in log_entries(session)] == [plain(e) for e in self.log]
        oracle = fold_log(session.to_plan(), self.log)
        rebuilt = SessionAggregate.load(session).fold
        for fold in (rebuilt, actor.fold):
            assert figures(fold) == figures(oracle)
        assert sum(step.points or 0 for step in numbers) == (oracle.score or 0)
        assert session.state == self.state

    async def _clean(self) -> None:
        runtime = runtimes._current
        if runtime is not None:
            await self._end(runtime)
        await turns()
        if left := asyncio.all_tasks(self.loop) - {asyncio.current_task()}:  # a fault cut them off
            for task in left:
                task.cancel()
            await asyncio.wait(left, timeout=callers.PATIENCE_S)
        await sync_to_async(connections.close_all)()


def plain(entry: Measurement | Change) -> Any:
    if isinstance(entry, Change):
        return (entry.kind, entry.value)
    return (entry.number, entry.time_s, entry.side, entry.value)


def figures(fold: SessionFold) -> tuple[Any, ...]:
    return (
        fold.state,
        fold.last_number,
        fold.score,
        fold.goal,
        fold.phase_index,
        fold.phase_strides,
        fold.active_s,
        fold.feedback,
        fold.trained,
        fold.phases,
    )
