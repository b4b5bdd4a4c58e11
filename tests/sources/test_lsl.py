"""Streams, their clocks and their absence."""

import asyncio
import builtins
import sys
from types import ModuleType

import numpy as np
import pytest

from rehab.sources.intake import Intake
from rehab.sources.lsl import ClockCorrection, choose_streams, load_pylsl
from rehab.sources.reporting import SourceError
from rehab.sources.synthetic import walk
from tests.sources.fake_lsl import FakeLsl
from tests.sources.intake_harness import MASS, NAMES, IntakeHarness, measure
from tests.sources.labs import LslLab, until_strides
from tests.support.synthetic_recordings import make_signals


def test_a_correction_that_wanders_never_turns_the_stamps_around():
    rng = np.random.default_rng(1)
    correction = ClockCorrection(5.0)
    stamps = np.arange(100_000) / 1000
    times = []
    for start in range(0, len(stamps), 50):
        correction.update(5.0 + rng.normal(0, 0.002))
        times.append(correction.correct(stamps[start : start + 50]))
    found = np.concatenate(times)

    assert (np.diff(found) > 0).all()
    assert np.abs(found - stamps - 5.0).max() < 0.003


def test_another_clock_is_taken_at_once():
    correction = ClockCorrection(5.0)
    correction.update(900.0)
    assert correction.correct(np.array([1.0])) == pytest.approx([901.0])


def test_streams_are_chosen_or_listed():
    lsl = FakeLsl()
    assert choose_streams([], []) == ([], choose_streams([], [])[1])
    one = lsl.add("Treadmill", NAMES, 1000)
    assert choose_streams(lsl.outlets, []) == ([one], "")
    other = lsl.add("Mocap", NAMES, 100)
    with pytest.raises(SourceError, match="Treadmill .6 channels, 1000 Hz, lab., Mocap"):
        choose_streams(lsl.outlets, [])
    assert choose_streams(lsl.outlets, ["Mocap", "Treadmill-1"]) == ([other, one], "")
    assert "No LSL stream EMG is here yet" in choose_streams(lsl.outlets, ["EMG"])[1]
    lsl.add("Mocap", NAMES, 100)
    with pytest.raises(SourceError, match="Several LSL streams are called Mocap"):
        choose_streams(lsl.outlets, ["Mocap"])


def test_without_pylsl_the_cure_is_said(monkeypatch):
    monkeypatch.setitem(sys.modules, "pylsl", None)
    with pytest.raises(SourceError, match="pip install pylsl"):
        load_pylsl()


def test_a_folder_of_that_name_is_no_pylsl(monkeypatch):
    monkeypatch.setitem(sys.modules, "pylsl", ModuleType("pylsl"))
    with pytest.raises(SourceError, match="pip install pylsl"):
        load_pylsl()


async def test_a_stream_that_goes_away_while_it_is_opened_is_tried_again(tmp_path):
    lab = LslLab(tmp_path)
    lab.outlet.vanishes = True
    lab.outlet.push([3.0, 0.7], step_s=1.0)
    found = await read_streams(lab, IntakeHarness(), 1)

    assert found[0].value == 3.0
    assert any("went away" in text for text in lab.said)


def test_without_liblsl_the_cure_is_said(monkeypatch):
    real = builtins.__import__

    def fail(name, *rest):
        if name == "pylsl":
            raise RuntimeError("LSL binary library file was not found.\nPlease make sure …")
        return real(name, *rest)

    monkeypatch.delitem(sys.modules, "pylsl", raising=False)
    monkeypatch.setattr("importlib.import_module", fail)
    with pytest.raises(SourceError, match="library file was not found.*liblsl"):
        load_pylsl()


async def read_streams(lab, harness, count):
    source = lab.make("--mass", str(MASS))
    intake = Intake(harness.feed, source.settings, lab.said.append, harness.time)
    task = asyncio.create_task(source.read(intake))
    try:
        return await until_strides(harness, count)
    finally:
        task.cancel()
        await asyncio.gather(task, return_exceptions=True)


async def test_two_streams_of_two_clocks_and_rates_become_one_walk(tmp_path):
    made = make_signals(list(walk(seed=4, strides=15)), MASS, seed=4)
    lab = LslLab(tmp_path)
    forces = lab.lsl.add("Treadmill", ("left_force_n", "right_force_n"), 100, ahead_s=7.0)
    angles = ("left_moment_nm", "left_angle_rad", "right_moment_nm", "right_angle_rad")
    mocap = lab.lsl.add("Mocap", angles, 50, ahead_s=-3.0)
    lab.typed = ["--stream", "Treadmill", "Mocap"]
    left, right = made.left, made.right
    columns = zip(left.moment_nm, left.angle_rad, right.moment_nm, right.angle_rad, strict=True)
    for number, (time_s, row) in enumerate(zip(made.t_s, columns, strict=True)):
        forces.samples.put(([left.force_n[number], right.force_n[number]], time_s - 7.0))
        if number % 2 == 0:
            mocap.samples.put((list(row), time_s + 3.0))
    expected = measure(made, 100.0)
    found = await read_streams(lab, IntakeHarness(), len(expected) - 2)

    assert sum(not m.reasons for m in found) >= 0.7 * len(found)
    by_time = {s.terminal_contact_s: s for s in expected}
    times = np.array(list(by_time))
    for stride in found:
        if not stride.reasons:
            nearest = by_time[times[np.abs(times - stride.time_s).argmin()]]
            assert nearest.terminal_contact_s == pytest.approx(stride.time_s, abs=0.003)
            assert stride.value == pytest.approx(nearest.a2_w_kg, rel=0.1)


async def test_channels_without_a_meaning_are_refused_with_the_cure(tmp_path):
    lab = LslLab(tmp_path)
    lab.lsl.add("EEG", ("Fz", "Cz"), 250)
    lab.typed = ["--stream", "EEG"]
    with pytest.raises(SourceError, match=r"Fz, Cz.*--columns"):
        await asyncio.wait_for(
            lab.make().read(Intake(IntakeHarness().feed, lab.make().settings, print)), 5
        )


async def test_real_streams_are_heard(tmp_path):
    try:
        pylsl = load_pylsl()
    except SourceError as problem:
        pytest.skip(str(problem))
    name = f"GARRY test {tmp_path.name}"
    info = pylsl.StreamInfo(name, "Gait", 2, 0, "double64", tmp_path.name)
    info.set_channel_labels(["value", "stance_s"])
    outlet = pylsl.StreamOutlet(info)
    if not await asyncio.to_thread(pylsl.resolve_byprop, "name", name, 1, 5.0):
        pytest.skip("this machine's network lets no LSL stream through")
    lab = LslLab(tmp_path)
    lab.lsl = pylsl
    lab.typed = ["--stream", name]

    async def push():
        await asyncio.to_thread(outlet.wait_for_consumers, 10.0)
        for number in range(5):
            outlet.push_sample([3.0 + number, 0.7])

    pushing = asyncio.create_task(push())
    found = await read_streams(lab, IntakeHarness(), 5)
    await pushing

    assert [m.value for m in found] == [3.0, 4.0, 5.0, 6.0, 7.0]
    assert found[0].extra == {"stance_s": 0.7}
