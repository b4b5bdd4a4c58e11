"""Whatever a source and its connection do, the log is what a plain list says it should be."""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterator
from typing import Any

import pytest
from hypothesis import HealthCheck, Phase, settings
from hypothesis.stateful import run_state_machine_as_test

from rehab.sessions.live import runtime as runtimes
from rehab.sessions.live.consumers import source as source_consumers
from rehab.sessions.live.session import commit_transaction
from rehab.sessions.live.session.aggregate import SessionAggregate
from rehab.sessions.live.session.group_commit import Writer
from rehab.sessions.live.session.live_session import LiveSession
from rehab.training.steps import Measurement
from tests.support import callers
from tests.support.callers import Caller, build_place
from tests.support.first_fault import FirstFault, Found
from tests.support.power_switch import PowerSwitch
from tests.support.source_machine import Sources


@pytest.fixture
def walk(transactional_db: None, monkeypatch: pytest.MonkeyPatch) -> Iterator[Callable[..., None]]:
    """Return what runs the machine, in a place of its own. No writer outlives it."""
    switch = PowerSwitch()
    threads = set(threading.enumerate())
    write = Writer._write

    def write_while_there_is_power(self: Writer, jobs: Any) -> None:
        switch.wait(self)
        if self not in switch.dead:
            write(self, jobs)

    monkeypatch.setattr(Writer, "_write", write_while_there_is_power)
    monkeypatch.setattr(Sources, "switch", switch, raising=False)
    monkeypatch.setattr(Sources, "place", build_place("elm"), raising=False)
    runtimes._current = None
    Caller.open_ones.clear()

    def walk(machine: type[Sources] = Sources, *, max_examples: int, **more: Any) -> None:
        run_state_machine_as_test(
            machine,
            settings=settings(
                max_examples=max_examples,
                stateful_step_count=30,
                deadline=None,
                derandomize=True,  # the same walks each time; --hypothesis-seed tries others
                suppress_health_check=list(HealthCheck),
                **more,
            ),
        )

    yield walk
    assert not [t for t in set(threading.enumerate()) - threads if t.name == "garry-writer"]


@pytest.mark.wide
@pytest.mark.parametrize("walks", [8, pytest.param(25, marks=pytest.mark.long)])
def test_the_log_is_what_a_plain_list_says(walk: Callable[..., None], walks: int) -> None:
    walk(max_examples=walks)


# --- the machine can fail: seeded faults ----------------------------------------------------------


def acknowledge_before_the_commit(monkeypatch: pytest.MonkeyPatch) -> None:
    take = LiveSession.record_step

    def take_and_acknowledge(self: LiveSession, measurement: Measurement, *args: Any, **more: Any):
        take(self, measurement, *args, **more)
        if self.source is not None:
            self.source.outbox.acknowledge(measurement.number)

    monkeypatch.setattr(LiveSession, "record_step", take_and_acknowledge)


def check_no_epoch(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(commit_transaction, "_check_logs", lambda epochs, firsts: None)


def take_other_content_for_the_same(monkeypatch: pytest.MonkeyPatch) -> None:
    async def look(*_: Any) -> None:
        await callers.turns()  # as long as a look into the database takes: one ack for each step

    monkeypatch.setattr(source_consumers, "check_same", look)


def forget_where_a_change_stood(monkeypatch: pytest.MonkeyPatch) -> None:
    change = SessionAggregate.change

    def change_from_the_start(self: SessionAggregate, *args: Any) -> list[Any]:
        rows: list[Any] = change(self, *args)
        rows[0].after_number = 0
        return rows

    monkeypatch.setattr(SessionAggregate, "change", change_from_the_start)


# Whatever is next said to a source whose session was rebuilt, since a step could not be stored.
SENT_AWAY = {"_connect", "repeat", "reorder", "contradict", "the_source_is_still_welcome"}
# Each with the rules or checks of the machine that may trip over it.
FAULTS = {
    acknowledge_before_the_commit: {"_connect", "_lose_all_but", "_note_acks", "_look_at_the_log"},
    check_no_epoch: {"_change", "_look_at_the_log", "wait_until_committed", *SENT_AWAY},
    take_other_content_for_the_same: {"contradict"},
    forget_where_a_change_stood: {"_look_at_the_log"},
}


@pytest.mark.long
# A fault ends the walk while writers may be at work: what their threads then raise is no fault.
@pytest.mark.filterwarnings("ignore::pytest.PytestUnhandledThreadExceptionWarning")
@pytest.mark.filterwarnings("ignore::pytest.PytestUnraisableExceptionWarning")
@pytest.mark.parametrize(
    ("fault", "places"), FAULTS.items(), ids=lambda one: getattr(one, "__name__", "")
)
def test_a_seeded_fault_is_found(
    fault: Callable[[pytest.MonkeyPatch], None],
    places: set[str],
    walk: Callable[..., None],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    fault(monkeypatch)
    monkeypatch.setattr(callers, "PATIENCE_S", 1.0)  # it will wait for an answer in vain
    with pytest.raises(Found) as found:
        walk(FirstFault, max_examples=400, phases=[Phase.generate])
    where = pytest.ExceptionInfo.from_exception(found.value.fault).traceback
    assert places & {entry.name for entry in where}
