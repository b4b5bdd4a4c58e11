"""The black box: bounded, never waited for, and there when something stopped the robot."""

import threading
import time

import pytest

from robot.black_box import recorder
from robot.black_box.recorder import AFTER_S, BEFORE_S, CLOSED, DIED, WAITING, BlackBox
from robot.black_box.ring import Ring
from robot.wire.incident import read_lines, unpack


class Clock:
    now_s = 1000.0

    def __call__(self):
        return self.now_s


@pytest.fixture
def clock():
    return Clock()


def begun(folder, clock):
    box = BlackBox(folder, clock)
    box.begin()
    return box


def kept_files(folder):
    return sorted(folder.glob("incident-*.jsonl"))


def test_what_was_before_and_after_a_stop_is_kept_and_sent(tmp_path, clock):
    box = begun(tmp_path, clock)
    for tick in range(600):
        clock.now_s = 1000 + 0.1 * tick
        box.note(tick=[tick, 0, 0, 0, 0, 0, 0])
        if tick == 500:
            box.retain("bump", 7)
            box.retain("tether", 7)  # what follows from it
        if not tick % 5:
            box.write()
    box.write()
    (file,) = kept_files(tmp_path)
    assert file.name.endswith("-bump.jsonl")
    records = read_lines(file.read_text())
    ticks = [one["tick"][0] for one in records if "tick" in one]
    assert ticks == list(range(500 - int(10 * BEFORE_S), 500 + int(10 * AFTER_S) + 1))
    assert [one["retained"] for one in records if "retained" in one] == ["bump", "tether"]
    (incident,) = box.incidents
    assert (incident.reason, incident.session, incident.at_s) == ("bump", 7, pytest.approx(1050))
    assert unpack(incident.recording) == records


def test_bytes_of_a_base_stay_in_its_own_file(tmp_path, clock):
    box = begun(tmp_path, clock)
    box.note(bytes="aa55")
    box.retain("bump", 7)
    clock.now_s += AFTER_S
    box.write()
    assert "aa55" in kept_files(tmp_path)[0].read_text()
    assert "aa55" not in str(unpack(box.incidents[0].recording))


def test_a_day_of_records_takes_two_files_of_bounded_size(tmp_path, clock):
    ring = Ring(tmp_path, file_bytes=10_000)
    ring.begin()
    line = "x" * 99 + "\n"
    for number in range(2_000):
        ring.append(f"{number:5} {line}")
        assert sum(path.stat().st_size for path in tmp_path.iterdir()) <= 20_000
    lines = ring.read().splitlines()
    numbers = [int(one.split()[0]) for one in lines]
    assert numbers == list(range(numbers[0], 2_000))
    assert len(lines) >= 90


def test_the_files_of_incidents_are_bounded_and_the_newest_stay(tmp_path, clock, monkeypatch):
    monkeypatch.setattr(recorder, "MAX_FILES", 3)
    box = begun(tmp_path, clock)
    for number in range(6):
        box.retain(f"reason{number}", 7)
        clock.now_s += AFTER_S
        box.write()
    assert [one.stem.rsplit("-", 1)[1] for one in kept_files(tmp_path)] == [
        *("reason3", "reason4", "reason5")
    ]
    assert len(box.incidents) <= recorder.TO_SEND


def test_a_disk_that_hangs_holds_nothing_up_and_what_it_costs_is_told(tmp_path, monkeypatch):
    goes_on = threading.Event()
    append = Ring.append

    def hang(ring, text):
        goes_on.wait(20)
        append(ring, text)

    monkeypatch.setattr(Ring, "append", hang)
    monkeypatch.setattr(recorder, "WRITE_EVERY_S", 0.01)
    with BlackBox(tmp_path) as box:
        longest_s = 0.0
        for number in range(3 * WAITING):
            began_s = time.perf_counter()
            box.note(number=number)
            longest_s = max(longest_s, time.perf_counter() - began_s)
        assert box.lost >= WAITING
        assert len(box._waiting) <= WAITING
        goes_on.set()
    assert longest_s < 1  # the disk would take 20
    records = read_lines(Ring(tmp_path).read())
    written = [one["number"] for one in records if "number" in one]
    assert written[-1] == 3 * WAITING - 1
    assert sum(one.get("lost", 0) for one in records) == 3 * WAITING - len(written)


def test_a_disk_that_is_full_is_said_and_recording_goes_on_later(tmp_path, clock, monkeypatch):
    monkeypatch.setattr(recorder, "WRITE_EVERY_S", 0.01)
    append, full, refused = Ring.append, threading.Event(), []
    full.set()

    def refuse(ring, text):
        if full.is_set():
            refused.append(str(text))
            raise OSError(28, "No space left on device")
        append(ring, text)

    monkeypatch.setattr(Ring, "append", refuse)

    def until(holds):
        end_s = time.monotonic() + 10
        while not holds():
            assert time.monotonic() < end_s
            time.sleep(0.005)

    with BlackBox(tmp_path) as box:
        box.note(number=1)
        until(lambda: "number" in "".join(refused))
        until(lambda: "No space left" in box.problem)
        full.clear()
        box.note(number=2)
        until(lambda: not box.problem)
    records = read_lines(Ring(tmp_path).read())
    assert [one["number"] for one in records if "number" in one] == [2]
    assert sum(one.get("lost", 0) for one in records) == 1


def test_a_worker_that_died_leaves_its_last_seconds(tmp_path, clock):
    box = begun(tmp_path, clock)
    box.note(number=1)
    box.write()
    with (tmp_path / "ring-b.jsonl").open("a") as file:
        file.write('{"at_s":1000.1,"numb')  # it died while it wrote
    begun(tmp_path, clock)
    (file,) = kept_files(tmp_path)
    assert file.name.endswith(f"-{DIED}.jsonl")
    assert [one.get("number") for one in read_lines(file.read_text())] == [1]


def test_one_that_closed_leaves_no_incident_but_what_it_had_to_keep(tmp_path):
    with BlackBox(tmp_path) as box:
        box.note(number=1)
    with BlackBox(tmp_path) as box:
        box.retain("stopped", None)
    (file,) = kept_files(tmp_path)
    assert file.name.endswith("-stopped.jsonl")
    assert CLOSED in Ring(tmp_path).read()
