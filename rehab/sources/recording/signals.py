"""Recorded signals as strides, measured by ``rehab.gait``."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from rehab.gait import check_signals, measure_strides
from rehab.gait.recordings.csv_files import read_mass
from rehab.gait.recordings.readers import read_signals
from rehab.gait.signals.clock import estimate_rate
from rehab.gait.signals.frame_clock import find_frame_problem
from rehab.sources.intake.measurements import to_measurement
from rehab.sources.recording.table import RecordingError
from rehab.training.steps import Measurement, Side


def measure_file(
    path: Path,
    columns: Sequence[str] | None,
    mass_kg: float | None,
    rate_hz: float | None,
    look_ahead_s: float,
    side: Side | None,
    *,
    is_overground: bool,
) -> tuple[list[Measurement], list[str]]:
    """Return the strides of a file in the order walked, and the messages of its self-check.

    ``side`` selects a leg; None returns both. Raises RecordingError for a file that cannot be read
    and GaitInputError for signals that nothing can be measured from.
    """
    try:
        t_s, legs, frames, says_so = read_signals(path, pairs=columns)
    except OSError as problem:
        raise RecordingError(f"{path} cannot be read: {problem.strerror}.") from None
    is_overground = is_overground or says_so
    rate_hz = estimate_rate(t_s) if rate_hz is None else rate_hz
    mass_kg = read_mass(path) if mass_kg is None else mass_kg
    found = measure_strides(
        t_s,
        legs,
        rate_hz=rate_hz,
        mass_kg=mass_kg,
        look_ahead_s=look_ahead_s,
        is_overground=is_overground,
        frame=frames,
    )
    check = check_signals(
        t_s,
        legs.get("left"),
        legs.get("right"),
        rate_hz=rate_hz,
        mass_kg=mass_kg,
        strides=found,
        is_overground=is_overground,
    )
    strides: list[Measurement] = []
    for stride in found:
        named = to_measurement(stride, len(strides) + 1, side or Side.LEFT)
        if named is not None and side in {None, named.side}:
            strides.append(named)
    messages = [find_frame_problem(t_s, frames), *(finding.message for finding in check.findings)]
    return strides, [message for message in messages if message]
