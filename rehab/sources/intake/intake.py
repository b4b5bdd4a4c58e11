"""The entry through which rows of a lab become strides of a session."""

from __future__ import annotations

import asyncio
import time
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import replace

import numpy as np

from rehab.gait import Stride
from rehab.gait.recordings.column_mapping import SIDES
from rehab.gait.recordings.inverse_dynamics import add_computed
from rehab.gait.selfcheck.cures import CURES
from rehab.sources.client import LiveFeed
from rehab.sources.intake.alignment import FRAME, Alignment, Channel, Floats
from rehab.sources.intake.measurements import from_wearable, to_measurement
from rehab.sources.intake.pipeline import SignalPipeline
from rehab.sources.intake.quality import SignalQuality
from rehab.sources.intake.recorder import SignalRecorder
from rehab.sources.intake.rows import (
    TIMES,
    VALUE,
    BadRow,
    Cell,
    read_sample,
    read_stride,
)
from rehab.sources.intake.settings import IntakeSettings
from rehab.sources.intake.table_columns import TablePlans
from rehab.sources.intake.treadmill_and_heart_rate import NAMES, read_devices
from rehab.sources.intake.wearable_pipeline import Sided, WearablePipeline
from rehab.sources.reporting import Notify, SourceError
from rehab.training.steps import HEART_RATE, Measurement, Side
from robot.wire.limits import MAX_EXTRA

REPEAT_S = 10.0  # before the same warning is shown again
BEAT_HOLDS_S = 10.0  # an older heart rate is none
CURE_OF = {str(reason): text for reason, text in CURES.items()}


class Intake:
    """Turns rows into strides, and puts these into a ``LiveFeed``.

    Rows that cannot be read are counted, and reported with the cure, each kind at most every ten
    seconds. Only raw signals of a walker whose mass is unknown stop it.

    Parameters
    ----------
    feed
        Where strides go.
    settings
        How to read what comes.
    notify
        Called with lines for the person who runs the source.
    monotonic
        Our clock [s].
    """

    def __init__(
        self,
        feed: LiveFeed,
        settings: IntakeSettings,
        notify: Notify,
        monotonic: Callable[[], float] = time.monotonic,
    ) -> None:
        self.quality = SignalQuality(monotonic)
        self._feed = feed
        self._settings = settings
        self._notify = notify
        self._monotonic = monotonic
        self._alignment = Alignment()
        self._pipeline: SignalPipeline | None = None
        over = settings.is_overground
        self._recorder = (
            SignalRecorder(settings.keep, notify, is_overground=over) if settings.keep else None
        )
        self._columns = {
            column.name: ((side, channel), column)
            for side, leg in settings.columns.legs.items()
            for channel, column in leg.items()
        }
        self._frame = None if settings.columns.frame is None else settings.columns.frame.name
        self._counted: str | None = None  # the stream whose frame numbers are used
        self._rate_hz = settings.rate_hz
        self._wearables = WearablePipeline(settings.wearables, notify)
        if settings.wearables:
            self._columns = {}
        self._plans = TablePlans(self._columns, self._frame)
        self._problem: SourceError | None = None
        self._failed = asyncio.Event()
        self._number = 0
        self._said: dict[str, float] = {}  # by devices beside the signals
        self._beat_s = 0.0  # when the heart rate was last said
        self._warned_s: dict[str, float] = {}
        self._reported_reasons: set[str] = set()
        self._doubts: tuple[str, ...] = ()  # why valid strides do not count
        self._doubted_at = 0  # how many times the session had been resumed then

    @property
    def side(self) -> Side:
        """The leg of rows that name none."""
        return self._settings.side or self._feed.trained_side or Side.LEFT

    async def wait_for_start(self) -> None:
        """Return once the session runs."""
        while not self._feed.is_running:  # noqa: ASYNC110 (there is no event for it, and no hurry)
            await asyncio.sleep(0.05)

    async def watch(self) -> None:
        """Raise SourceError once there is a problem that only a person at the machine can solve."""
        await self._failed.wait()
        if self._problem is not None:
            raise self._problem

    def expect_rate(self, rate_hz: float) -> None:
        """Set the rate of the samples [Hz] that their sender declares; the command line's wins."""
        self._rate_hz = self._rate_hz or rate_hz

    def set_clock_error(self, side: Side, place: str, error_s: float) -> None:
        """Set how far a worn sensor's times may be off those of others [s]."""
        self._wearables.clock_errors_s[side, place] = error_s

    def add_rows(self, rows: Iterable[Mapping[str, Cell]]) -> None:
        """Add rows in the order in which they came."""
        samples: list[Mapping[str, Cell]] = []
        for row in rows:
            if not NAMES.isdisjoint(row):
                self.note_devices(read_devices(row))
            if VALUE in row:
                self._add_stride(row)
            elif self._columns.keys() & row.keys() or self._wearables.names & row.keys():
                if samples and row.keys() != samples[0].keys():
                    self._add_samples(samples)
                    samples = []
                samples.append(row)
            elif NAMES.isdisjoint(row):
                names = ", ".join(list(row)[:4])
                known = ", ".join([*self._columns, *self._wearables.names][:3])
                self.reject_row(
                    f"A row with {names} is neither a stride nor a sample: a stride has a value, a "
                    f"sample {known} or more. Rename them, or map them with --columns."
                )
        if samples:
            self._add_samples(samples)

    def note_devices(self, said: Mapping[str, float]) -> None:
        """Send what a treadmill or a heart-rate sensor says with the strides from now on."""
        self._said |= said
        if HEART_RATE in said:
            self._beat_s = self._monotonic()

    def reject_row(self, text: str) -> None:
        """Count a row that cannot be used, and report why, at most every ten seconds."""
        self.quality.bad_rows += 1
        self._warn(text[-40:], text)  # the cure

    def describe(self) -> str:
        """Return in one line how well the source is received, and reset the counts."""
        return self.quality.describe()

    def finish(self) -> None:
        """End the feed: nothing more will come."""
        if self._pipeline is not None:
            self._put_strides(self._pipeline.finish())
        self._put_worn(self._wearables.finish())
        self._feed.finish()

    def close(self) -> None:
        """Close the file of recorded signals, if there is one."""
        if self._recorder is not None:
            self._recorder.close()

    # --- Strides ---

    def _add_stride(self, row: Mapping[str, Cell]) -> None:
        try:
            stride, excluded = read_stride(row, self._number + 1, self.side, self._monotonic())
        except BadRow as problem:
            self.reject_row(str(problem))
            return
        if excluded:
            self._warn(
                f"left out {excluded}",
                f"Left out of the strides: {', '.join(excluded)[:120]}. Up to 40 further values "
                "can travel, numbers named with letters, digits or _ . : -",
            )
        self._put(stride, is_timed=any(name in row for name in TIMES))

    def _put(self, stride: Measurement, *, is_timed: bool) -> None:
        if HEART_RATE in self._said and self._monotonic() - self._beat_s > BEAT_HOLDS_S:
            del self._said[HEART_RATE]
        if self._said and len(stride.extra) + len(self._said) <= MAX_EXTRA:
            stride = replace(stride, extra={**self._said, **stride.extra})
        self._number += 1
        self.quality.record_stride(stride, is_timed=is_timed)
        for reason in stride.reasons:
            if reason not in self._reported_reasons:
                self._reported_reasons.add(reason)
                cure = CURE_OF.get(reason, "")
                self._notify(f"A stride ({stride.side}) does not count: {reason}. {cure}".rstrip())
        self._feed.put(stride)

    def _put_strides(self, strides: Iterable[Stride]) -> None:
        for stride in strides:
            named = to_measurement(stride, self._number + 1, self.side)
            if named is not None:
                reasons = named.reasons or self._standing_doubts
                self._put(replace(named, reasons=reasons), is_timed=False)

    @property
    def _standing_doubts(self) -> tuple[str, ...]:
        """What a person has not answered yet: by going on after a pause the signals are right."""
        if self._feed.resumed > self._doubted_at:
            self._doubts = ()
        return self._doubts

    def _put_worn(self, strides: Iterable[Sided]) -> None:
        for stride in strides:
            self._put(from_wearable(*stride, self._number + 1), is_timed=False)

    # --- Samples ---

    def _add_samples(self, rows: list[Mapping[str, Cell]]) -> None:
        """Add rows that have the same cells."""
        used = {*self._columns, *self._wearables.names, self._frame}
        names = [name for name in rows[0] if name in used]
        time = self._settings.columns.time
        times, cells = [], []
        for row in rows:
            try:
                time_s, numbers = read_sample(row, time.name, names)
            except BadRow as problem:
                self.reject_row(str(problem))
                continue
            times.append(time_s * time.factor)
            cells.append(numbers)
        if cells:
            there = np.array([[cell is not None for cell in row] for row in cells])
            table = np.array(cells, dtype=np.float64)
            self.add_table(",".join(names), names, np.array(times), table, there)

    def add_table(
        self,
        stream: str,
        names: Sequence[str],
        t_s: Floats,
        table: Floats,
        there: Floats | None = None,
    ) -> None:
        """Add samples of a stream as a table.

        Parameters
        ----------
        stream
            Any name that distinguishes it from others.
        names
            Of the columns; those that are mapped to no channel are excluded.
        t_s, table
            Times [s], shape (n,), and cells, shape (n, columns).
        there
            Whether each cell was sent, shape (n, columns); None for all.
        """
        if not len(t_s):
            return
        plan = self._plans.find(tuple(names))
        frames = None if plan.frame is None else table[:, plan.frame]
        self.quality.count_samples(stream, t_s, frames)
        if (problem := self.quality.frame_problem) and problem not in self._reported_reasons:
            self._reported_reasons.add(problem)
            self._notify(problem)
        if self._settings.wearables:
            columns = {n: table[:, p] for p, n in enumerate(names) if n in self._wearables.names}
            self._put_worn(self._wearables.add(t_s, columns, frames))
            return
        known, delays_s = plan.places, plan.delays_s
        values = dict(zip(plan.channels, table.T[known] * plan.factors, strict=True))
        if frames is not None and plan.frame is not None and self._is_counted(stream, values):
            force = next(place for place, (_, channel) in enumerate(values) if channel == "force")
            delays_s = [*delays_s, delays_s[force]]  # they count its samples
            known = [*known, plan.frame]
            values[FRAME] = frames
        sent = None if there is None else there[:, known]
        for samples in self._alignment.add(t_s, values, sent, delays_s, self._monotonic()):
            self._measure(*samples)

    def _is_counted(self, stream: str, values: Mapping[Channel, Floats]) -> bool:
        """Return whether a stream's numbers are used: those of the first one with a force."""
        if self._counted is None and any(channel == "force" for _, channel in values):
            self._counted = stream
        return stream == self._counted

    @property
    def forces(self) -> set[str]:
        """Names of the columns that hold vertical forces."""
        return {name for name, ((_, channel), _) in self._columns.items() if channel == "force"}

    def accepts(self, names: Iterable[str]) -> bool:
        """Return whether rows with these cells are strides or samples."""
        there = set(names)
        known = self._columns.keys() | self._wearables.names
        return VALUE in there or bool(known & there)

    def _measure(self, t_s: Floats, values: dict[Channel, Floats]) -> None:
        for side in SIDES:
            if (side, "ankle_forward") in values:
                leg = {name: channel for (own, name), channel in values.items() if own == side}
                add_computed(leg)
                values |= {(side, name): channel for name, channel in leg.items()}
        if self._recorder is not None:
            self._recorder.write(t_s, values)
        if self._pipeline is None:
            mass_kg = self._settings.mass_kg
            if mass_kg is None:
                self._problem = SourceError(
                    "Raw signals come, and the walker's body mass is not known. Give it in kg: "
                    "--mass 75. A2 is power by mass."
                )
                self._failed.set()
                return
            self._pipeline = SignalPipeline(
                mass_kg,
                self._rate_hz,
                self._settings.look_ahead_s,
                self._notify,
                is_overground=self._settings.is_overground,
            )
        self._put_strides(self._pipeline.add(t_s, values))
        findings = self._pipeline.check()
        if doubts := tuple(sorted({one.doubt for one in findings if one.doubt})):
            self._doubts, self._doubted_at = doubts, self._feed.resumed
        for finding in findings:
            where = f" ({finding.side} leg)" if finding.side else ""
            self._notify(f"Check of the first half minute{where}: {finding.message}")

    def _warn(self, kind: str, text: str) -> None:
        now_s = self._monotonic()
        if now_s - self._warned_s.get(kind, -REPEAT_S) >= REPEAT_S:
            if len(self._warned_s) > 100:
                self._warned_s.clear()
            self._warned_s[kind] = now_s
            self._notify(text)
