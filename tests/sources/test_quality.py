"""The quality line says in words what is wrong with a sender's clock, and what to do."""

import numpy as np

from rehab.sources.intake.quality import SignalQuality


class OurClock:
    now_s = 0.0

    def __call__(self):
        return self.now_s


def send(stamps, *, ahead_s=0.0, every=10):
    """Return the line after samples that come in chunks, as their stamps say."""
    clock = OurClock()
    quality = SignalQuality(clock)
    lines = []
    for first in range(0, len(stamps), every):
        chunk = stamps[first : first + every]
        clock.now_s = (chunk[-1] - stamps[0]) * (1 - ahead_s)
        quality.count_samples("stream", chunk)
        if first % 500 == 0:
            lines.append(quality.describe())
    return quality.describe(), lines


def test_nothing_is_said_of_a_good_clock():
    line, _ = send(np.arange(3000) / 100)

    assert not any(word in line for word in ("late", "lost", "drift"))


def test_late_samples_are_told_with_a_cure():
    stamps = np.arange(3000) / 100
    stamps[1500:1508] = stamps[1508] - 0.003 + np.arange(8) * 0.0003
    line, _ = send(stamps)

    assert "late by up to 77 ms (put back; close other programs on the lab's computer" in line
    assert "lost" not in line


def test_lost_samples_are_told_with_a_cure():
    stamps = np.delete(np.arange(3000) / 100, slice(1500, 1520))
    line, _ = send(stamps)

    assert "1 times lost for up to 210 ms (look at network and recorder)" in line
    assert "late" not in line


def test_clocks_that_drift_are_told_with_a_cure():
    line, _ = send(np.arange(6000) / 100, ahead_s=0.002)

    assert "clocks drift by +2.0 ms a second (let one clock stamp all channels)" in line


def test_frame_numbers_that_begin_later_are_judged():
    quality = SignalQuality(lambda: 0.0)
    t_s = np.arange(400) / 100
    quality.count_samples("stream", t_s[:200])
    quality.count_samples("stream", t_s[200:], np.full(200, 7.0))

    assert "stay as they are" in quality.frame_problem
