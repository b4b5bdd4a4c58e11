"""Plays a recording: a session with one row a stride, or raw signals with one row a sample.

Signals (layouts moore2013 and garry, or --columns) are measured whole before the first stride is
sent, with the same result as while somebody walks.
"""

from __future__ import annotations

import csv
from argparse import ArgumentParser, Namespace
from collections.abc import Sequence
from pathlib import Path

from rehab.sources.client import Display, NextStride, write_step
from rehab.sources.recording.layouts import LAYOUTS
from rehab.sources.recording.reading import read_recording
from rehab.sources.recording.sample_recordings import is_sample
from rehab.sources.reporting import Notify, SourceError
from rehab.sources.source import PlayedSource
from rehab.training.steps import Measurement, Side


class RecordingSource(PlayedSource):
    """A recorded walk, from its beginning in each session."""

    @classmethod
    def add_arguments(cls, parser: ArgumentParser) -> None:
        """Add the options of this source to a command line."""
        parser.add_argument("file", type=Path, metavar="FILE")
        parser.add_argument(
            "--layout", choices=sorted(LAYOUTS), help="of a session (default: by its header)"
        )
        signals = parser.add_argument_group("raw signals")
        signals.add_argument("--mass", type=float, metavar="KG", help="the walker's body mass")
        signals.add_argument("--rate", type=float, metavar="HZ", help="default: by the times")
        signals.add_argument("--look-ahead", type=float, default=0.05, metavar="S")
        signals.add_argument("--columns", nargs="+", metavar="CHANNEL=COLUMN")
        signals.add_argument(
            "--overground",
            action="store_true",
            help="over plates in a floor, a step or two at a time",
        )

    def __init__(self, options: Namespace, notify: Notify) -> None:
        """Read the whole file. Raises RecordingError, GaitInputError or UnsendableStride."""
        self._notify = notify
        self.simulated = is_sample(options.file)
        self._limit: int | None = options.strides
        wanted = Side(options.side) if options.side else None
        self._recorded_side: Side | None = None  # the only one there is
        self._strides: Sequence[Measurement]
        if options.columns or holds_signals(options.file):
            self._strides = self._measure(options, wanted)
        else:
            recording = read_recording(options.file, options.layout, trained_side=wanted)
            self._strides = tuple(recording)
            self._recorded_side = recording.trained_side
        for stride in self._strides:
            write_step(stride, stride.number)

    def open_walk(self, trained_side: Side) -> NextStride:
        """Play the recording from its beginning."""
        if self._recorded_side not in {None, trained_side}:
            self._notify(
                f"The session trains the {trained_side} leg, the recording the other one: its "
                "strides are stored and not scored."
            )
        strides = iter(self._strides[: self._limit])

        def walk(_display: Display) -> Measurement | None:
            return next(strides, None)

        return walk

    def _measure(self, options: Namespace, wanted: Side | None) -> Sequence[Measurement]:
        """Return the strides of recorded signals, of the wanted leg or of both."""
        from rehab.sources.recording.signals import measure_file

        strides, findings = measure_file(
            options.file,
            options.columns,
            options.mass,
            options.rate,
            options.look_ahead,
            wanted,
            is_overground=options.overground,
        )
        for finding in findings:
            self._notify(f"{options.file.name}: {finding}")
        if not strides:
            raise SourceError(
                f"{options.file.name} holds no stride of {wanted or 'either'} leg. Check the "
                "columns, the units and the body mass."
            )
        valid = sum(not stride.reasons for stride in strides)
        self._notify(f"{options.file.name}: {len(strides)} strides measured, {valid} valid.")
        return strides


def holds_signals(path: Path) -> bool:
    """Return whether a file's header is one of signals; not so for files that cannot be read."""
    try:
        with path.open(encoding="utf-8-sig", newline="") as file:
            first = file.readline(64 * 1024)
    except (OSError, UnicodeDecodeError):
        return False
    header = next(csv.reader([first], delimiter=max(",;\t", key=first.count)), [])
    names = {name.strip() for name in header}
    # Unlike strides they have a time and forces.
    return {"time", "LeftGRF_y"} <= names or (
        "time_s" in names and bool({"left_force_n", "right_force_n"} & names)
    )
