"""Lab Streaming Layer: outlets of raw signals or strides, found on the network by their name.

pylsl is optional: ``pip install pylsl`` on the machine that runs this source.
"""

from __future__ import annotations

import asyncio
import importlib
import threading
import time
from argparse import ArgumentParser, Namespace
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rehab.sources.intake import Intake, IntakeSettings, add_signal_arguments
from rehab.sources.reporting import Notify, SourceError
from rehab.sources.source import LiveSource

# How long to look for streams; one on the same network answers within 0.7 s
# (docs/reference/gait.md#streaming).
RESOLVE_S = 1.0
PULL_S = 0.2
SILENT_S = 1.0
CORRECT_EVERY_S = 5.0
BUFFER_S = 360
# What pylsl raises for streams that do not answer or are gone: TimeoutError, LostError.
LOST = (RuntimeError, TimeoutError)
CHUNK = 1024
SLEW, JUMP_S = 0.001, 0.1


class ClockCorrection:
    """Converts a sender's time stamps to this machine's clock, without steps in between.

    The measured difference varies by fractions of a millisecond. It is followed by at most ``SLEW``
    of the time that passes; a change of more than ``JUMP_S`` is another clock, and applied at once.
    """

    def __init__(self, measured_s: float) -> None:
        self.offset_s = self._target_s = measured_s
        self._last_s: float | None = None

    def update(self, measured_s: float) -> None:
        """Set the newly measured difference [s], our clock less the sender's."""
        self._target_s = measured_s
        if abs(measured_s - self.offset_s) > JUMP_S:
            self.offset_s = measured_s

    def correct(self, stamps_s: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the times of stamps on this machine's clock."""
        passed_s = 0.0 if self._last_s is None else max(0.0, float(stamps_s[-1]) - self._last_s)
        self._last_s = float(stamps_s[-1])
        most_s = SLEW * passed_s
        before_s = self.offset_s
        self.offset_s += min(max(self._target_s - self.offset_s, -most_s), most_s)
        # Spread over the stamps, so that their order stays.
        return stamps_s + np.linspace(before_s, self.offset_s, len(stamps_s) + 1)[1:]


@dataclass(frozen=True, slots=True)
class Stream:
    """An open stream: its inlet and the names of its channels."""

    name: str
    labels: tuple[str, ...]
    rate_hz: float
    inlet: Any


class LslSource(LiveSource):
    """Reads each stream in a thread of its own; all feed one intake."""

    @classmethod
    def add_arguments(cls, parser: ArgumentParser) -> None:
        """Add the options of this source to a command line."""
        parser.add_argument(
            "--stream",
            nargs="+",
            default=[],
            metavar="NAME",
            help="streams by name, type or source id (default: the only one there is)",
        )
        parser.add_argument(
            "--dejitter",
            action="store_true",
            help="let LSL smooth the time stamps (takes a minute to settle)",
        )
        add_signal_arguments(parser)

    def __init__(self, options: Namespace, notify: Notify, pylsl: Any = None) -> None:
        """Read the command line. Raises SourceError where LSL or the options cannot be used."""
        self.settings = IntakeSettings.read(options)
        self._wanted: list[str] = options.stream
        self._dejitter: bool = options.dejitter
        self._notify = notify
        self._pylsl = pylsl or load_pylsl()

    async def read(self, intake: Intake) -> None:
        """Read samples for as long as this runs."""
        streams = await self._find(intake)
        loop = asyncio.get_running_loop()
        stopped = threading.Event()
        for stream in streams:
            self._notify(f"Reading LSL stream {stream.name}: {', '.join(stream.labels)}.")
            if stream.rate_hz > 0 and any(label in intake.forces for label in stream.labels):
                intake.expect_rate(stream.rate_hz)

        def call_in_loop(function: Callable[..., object], *arguments: object) -> None:
            if not stopped.is_set():
                loop.call_soon_threadsafe(function, *arguments)

        threads = [
            threading.Thread(
                target=self._pull,
                args=(stream, call_in_loop, intake, stopped),
                name="lsl",
                daemon=True,
            )
            for stream in streams
        ]
        for thread in threads:
            thread.start()
        try:
            await asyncio.Event().wait()
        finally:
            stopped.set()
            for thread in threads:
                await asyncio.to_thread(thread.join, 2.0)

    async def _find(self, intake: Intake) -> list[Stream]:
        """Find and open the streams, however long it takes until they are there."""
        last_problem = ""
        while True:
            found = await asyncio.to_thread(self._pylsl.resolve_streams, RESOLVE_S)
            chosen, missing = choose_streams(found, self._wanted)
            if not missing:
                try:
                    opened = [await asyncio.to_thread(self._open, info) for info in chosen]
                except LOST as problem:
                    missing = f"An LSL stream went away while it was opened ({problem}). Start it."
                else:
                    for stream in opened:
                        check_labels(stream, intake)
                    return opened
            if missing != last_problem:
                self._notify(missing)
            last_problem = missing

    def _open(self, info: Any) -> Stream:
        flags = self._pylsl.proc_dejitter | self._pylsl.proc_monotonize if self._dejitter else 0
        inlet = self._pylsl.StreamInlet(info, max_buflen=BUFFER_S, processing_flags=flags)
        full = inlet.info(timeout=5.0)
        labels = full.get_channel_labels() or []
        count = full.channel_count()
        names = [str(label or f"ch{n}") for n, label in enumerate(labels, 1)]
        names += [f"ch{n}" for n in range(len(names) + 1, count + 1)]
        return Stream(full.name(), tuple(names), full.nominal_srate(), inlet)

    def _pull(
        self,
        stream: Stream,
        call_in_loop: Callable[..., None],
        intake: Intake,
        stopped: threading.Event,
    ) -> None:
        inlet = stream.inlet
        correction: ClockCorrection | None = None
        next_s = silent_s = time.monotonic()
        is_silent = False
        while not stopped.is_set():
            sample, stamp = inlet.pull_sample(timeout=PULL_S)
            now_s = time.monotonic()
            if sample is None:
                if now_s - silent_s > SILENT_S and not is_silent:
                    is_silent = True
                    text = (
                        f"LSL stream {stream.name} is silent. Start its sender; it is heard anew."
                    )
                    call_in_loop(self._notify, text)
                continue
            if is_silent:
                call_in_loop(self._notify, f"LSL stream {stream.name} is heard again.")
            silent_s, is_silent = now_s, False
            samples, stamps = inlet.pull_chunk(timeout=0.0, max_samples=CHUNK)
            if now_s >= next_s:
                next_s = now_s + CORRECT_EVERY_S
                correction = self._correct(inlet, correction)
            stamped = np.array([stamp, *stamps])
            t_s = stamped if correction is None else correction.correct(stamped)
            call_in_loop(add_samples, intake, stream, [sample, *samples], t_s)
        inlet.close_stream()

    def _correct(self, inlet: Any, correction: ClockCorrection | None) -> ClockCorrection | None:
        """Measure the sender's clock; return the old correction where it does not answer."""
        try:
            measured_s = inlet.time_correction(timeout=2.0 if correction is None else 0.01)
        except LOST:
            return correction
        if correction is None:
            return ClockCorrection(measured_s)
        correction.update(measured_s)
        return correction


def check_labels(stream: Stream, intake: Intake) -> None:
    """Raise SourceError for a stream whose channels are neither mapped nor a stride's."""
    if not intake.accepts(stream.labels):
        raise SourceError(
            f"LSL stream {stream.name} has other channels: {', '.join(stream.labels)}. Say which "
            "is which: --columns time=stamp left.force=… left.moment=… left.angle=…"
        )


def add_samples(
    intake: Intake, stream: Stream, samples: Sequence[Sequence[Any]], t_s: NDArray[np.float64]
) -> None:
    """Hand samples to the intake: strides as rows, signals as a table."""
    if "value" in stream.labels:
        times = [{"time_s": float(t)} for t in t_s]
        cells = (dict(zip(stream.labels, sample, strict=True)) for sample in samples)
        intake.add_rows([row | time for row, time in zip(cells, times, strict=True)])
    else:
        try:
            table = np.array(samples, dtype=np.float64)
        except ValueError:
            intake.reject_row(f"LSL stream {stream.name} sends text. Let it send numbers.")
            return
        intake.add_table(stream.name, stream.labels, t_s, table)


def choose_streams(found: Sequence[Any], wanted: Sequence[str]) -> tuple[list[Any], str]:
    """Return the streams that are wanted, and what is missing. Raises SourceError if ambiguous."""
    there = ", ".join(
        f"{s.name()} ({s.channel_count()} channels, {s.nominal_srate():g} Hz, {s.hostname()})"
        for s in found
    )
    if not wanted:
        if len(found) > 1:
            raise SourceError(f"Several LSL streams are here: {there}. Choose with --stream NAME.")
        missing = "" if found else "No LSL stream is here yet. Start its sender in this network."
        return list(found), missing
    chosen = []
    for name in wanted:
        fitting = [s for s in found if name in (s.name(), s.type(), s.source_id())]
        if len(fitting) > 1:
            raise SourceError(
                f"Several LSL streams are called {name}: {there}. Stop one, or choose by source id."
            )
        if not fitting:
            return [], f"No LSL stream {name} is here yet. Here are: {there or 'none'}."
        chosen += fitting
    return chosen, ""


def load_pylsl() -> Any:
    """Return the module pylsl. Raises SourceError where it is not installed."""
    try:
        pylsl = importlib.import_module("pylsl")
        pylsl.StreamInlet  # noqa: B018 (a folder of that name has none)
    except (AttributeError, ImportError, OSError, RuntimeError) as problem:
        raise SourceError(
            f"LSL cannot be used here ({str(problem).splitlines()[0][:120]}). Install it beside "
            "GARRY: pip install pylsl (on Linux without its own wheel, also the package liblsl)."
        ) from None
    return pylsl
