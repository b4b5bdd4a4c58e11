"""Ten minutes of both legs at 1 kHz in chunks: how fast, against bare filters and scans."""

from __future__ import annotations

import time
from statistics import median

import numpy as np
import pytest
from scipy.signal import butter, sosfiltfilt

from rehab.gait import LegSamples, TwoLegDetector
from rehab.sources.client import LiveFeed
from rehab.sources.intake import Intake, IntakeSettings
from rehab.sources.synthetic.signals import Sensors
from rehab.training.steps import Measurement, Side
from tests.support.synthetic_recordings import make_signals

REPEATS = 5
CHUNK = 50
RATE_HZ = 1000
MASS_KG = 75.0
LIVE_MAX, WHOLE_MAX = 3.0, 12.0  # more means that it got slower
# Rows come one by one, LSL hands over what its sender pushes at once, a simulated patient a stride.
SENT = [CHUNK, 1, 10, 20, 100, 1100, 600_000]


@pytest.fixture(scope="module")
def recording():
    rng = np.random.default_rng(0)
    times = np.cumsum(1.1 + 0.02 * rng.normal(size=545))
    strides = [
        Measurement(number=i + 1, time_s=float(at), side=Side.LEFT, value=2.5 + 0.2 * rng.normal())
        for i, at in enumerate(times)
    ]
    return make_signals(strides, MASS_KG, Sensors(rate_hz=RATE_HZ, jitter_s=0.00002))


def run_whole_floor(recording) -> float:
    """Time one zero-phase filter of all signals and one scan for contacts, whole.

    Nobody can walk with it: nothing is known before the recording ends.
    """
    sections = butter(2, 6 / (RATE_HZ / 2), output="sos")
    began = time.process_time()
    for leg in (recording.left, recording.right):
        sosfiltfilt(sections, np.array([leg.force_n, leg.moment_nm, leg.angle_rad]), axis=1)
        np.flatnonzero(np.diff(leg.force_n > 20))
    return time.process_time() - began


def cut(recording, chunk: int) -> list[tuple[np.ndarray, LegSamples, LegSamples]]:
    """Return a recording as its sender cuts it."""
    chunks = []
    for first in range(0, len(recording.t_s), chunk):
        part = slice(first, first + chunk)
        legs = [
            LegSamples(leg.force_n[part], leg.moment_nm[part], leg.angle_rad[part])
            for leg in (recording.left, recording.right)
        ]
        chunks.append((recording.t_s[part], *legs))
    return chunks


def run_live_floor(chunks) -> float:
    """Time the same work as samples come, nothing checked, nothing told.

    A chunk is copied into a buffer and scanned for contacts; moment and angle of a stance are
    filtered where it ends, with a quarter of a second of swing before it.
    """
    sections = butter(2, 6 / (RATE_HZ / 2), output="sos")
    began = time.process_time()
    buffer = np.empty((7, sum(len(t_s) for t_s, _, _ in chunks)))
    is_loaded, begins, at, stances = [False, False], [0, 0], 0, 0
    for t_s, left, right in chunks:
        table = np.array([t_s, *left[:3], *right[:3]])
        stop = at + table.shape[1]
        buffer[:, at:stop] = table
        for leg in (0, 1):
            loaded = buffer[1 + 3 * leg, at:stop] > 20
            if is_loaded[leg]:
                step = int(loaded.argmin())
                if loaded[step]:
                    continue
                is_loaded[leg] = False
                first = max(0, begins[leg] - RATE_HZ // 4)
                sosfiltfilt(sections, buffer[2 + 3 * leg : 4 + 3 * leg, first : at + step])
                stances += 1
            elif loaded[loaded.argmax()]:
                is_loaded[leg], begins[leg] = True, at + int(loaded.argmax())
        at = stop
    seconds = time.process_time() - began
    assert stances > 1080
    return seconds


def run_ours(chunks) -> tuple[float, int]:
    """Time a detector; return also how many strides were valid."""
    detector = TwoLegDetector(RATE_HZ, MASS_KG)
    strides = []
    began = time.process_time()
    for t_s, left, right in chunks:
        strides += detector.feed(t_s, left, right)
    return time.process_time() - began, sum(stride.valid for stride in strides)


def time_pushes(chunks) -> list[float]:
    """Return how long each push of a detector takes [s]."""
    detector = TwoLegDetector(RATE_HZ, MASS_KG)
    pushes = []
    for t_s, left, right in chunks:
        at = time.process_time()
        detector.feed(t_s, left, right)
        pushes.append(time.process_time() - at)
    return pushes


@pytest.mark.parametrize("chunk", SENT)
def test_speed(recording, chunk):
    """CPU time, which other programs do not use up, as a multiple of two floors.

    The aim is 3 × the same work done live. The whole recording filtered at once is what no live
    code can reach: a chunk's copy and scan alone take longer than its share of that.
    """
    walked_s = len(recording.t_s) / RATE_HZ
    chunks = cut(recording, chunk)
    wholes, lives, ours = [], [], []
    for _ in range(REPEATS if chunk > 1 else 1):
        wholes.append(run_whole_floor(recording))
        if chunk < RATE_HZ:
            lives.append(run_live_floor(chunks))
        seconds, valid = run_ours(chunks)
        ours.append(seconds)
        assert valid > 1080
    whole, seconds = median(wholes), median(ours)
    told = f"{seconds / whole:.1f} × the filter of the whole ({whole * 1000:.0f} ms)"
    if lives:
        live = median(lives)
        told += f", {seconds / live:.1f} × filter and scan as samples come ({live * 1000:.0f} ms)"
    p99 = float(np.percentile(time_pushes(chunks), 99))
    print(
        f"\ngait, both legs at 1 kHz, chunks of {chunk}: {seconds / walked_s * 600_000:.0f} ms of "
        f"CPU for ten minutes = {walked_s / seconds:,.0f} × real time; {told}; "
        f"p99 of a push {p99 * 1000:.2f} ms"
    )
    if lives:
        assert seconds < LIVE_MAX * live
    if chunk == CHUNK:
        assert seconds < WHOLE_MAX * whole
        assert p99 < 0.004


@pytest.mark.parametrize("chunk", [1, 10, CHUNK])
def test_intake_speed(recording, chunk):
    """The same with all that is before the detector in a source, by the samples of a minute."""
    settings = IntakeSettings(mass_kg=MASS_KG)
    sides = {"left": recording.left, "right": recording.right}
    rows = {
        column.name: getattr(sides[side], name)
        for side, leg in settings.columns.legs.items()
        for channel, column in leg.items()
        if (name := {"force": "force_n", "moment": "moment_nm", "angle": "angle_rad"}.get(channel))
    }
    table = np.array(list(rows.values())).T
    walked = 60 * RATE_HZ
    chunks = [
        (recording.t_s[first : first + chunk], table[first : first + chunk])
        for first in range(0, walked, chunk)
    ]
    spent = []
    for _ in range(REPEATS if chunk > 1 else 1):
        feed = LiveFeed()
        intake = Intake(feed, settings, lambda _text: None)
        intake.expect_rate(RATE_HZ)
        began = time.process_time()
        for t_s, cells in chunks:
            intake.add_table("stream", tuple(rows), t_s, cells)
        spent.append(time.process_time() - began)
        assert feed.excluded > 100
    seconds = median(spent)
    print(
        f"\ngait with intake, both legs at 1 kHz, chunks of {chunk}: {seconds * 10_000:.0f} ms of "
        f"CPU for ten minutes, {seconds / len(chunks) * 1e6:.0f} µs a chunk"
    )
