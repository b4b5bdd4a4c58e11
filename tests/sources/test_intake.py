"""Raw signals as labs send them, good and bad: an A2 that is right, or an invalid stride."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from rehab.gait import measure_strides
from rehab.gait.recordings.column_mapping import read_column_map
from rehab.gait.recordings.readers import read_signals
from rehab.gait.selfcheck.shapes import SHAPES
from rehab.sources.synthetic.signals import Sensors
from rehab.sources.synthetic.walker import walk
from rehab.training.steps import Side
from tests.sources.intake_harness import MASS, NAMES, IntakeHarness, measure, rows_of
from tests.support.synthetic_recordings import make_signals


def same(stride, other):
    return stride.value == pytest.approx(other.a2_w_kg, rel=0.02)


@pytest.mark.parametrize("chunk", [pytest.param(1, marks=pytest.mark.wide), 20, 1000])
def test_strides_are_those_of_the_recording(made, table, chunk):
    harness = IntakeHarness()
    harness.send(rows_of(table), chunk)
    harness.intake.finish()
    found = harness.strides()

    expected = measure(made)
    assert [(m.side, m.time_s) for m in found] == [(s.side, s.terminal_contact_s) for s in expected]
    assert [m.value for m in found] == [s.a2_w_kg for s in expected]
    assert [m.reasons for m in found] == [s.reasons for s in expected]
    assert {"stance_s", "swing_s", "step_s", "weight_ratio"} <= found[10].extra.keys()


def test_channels_of_different_rates_meet(made, table):
    """Force at 200 Hz, moment and angle at 100 Hz in rows of their own, which come later."""
    harness = IntakeHarness()
    forces, others = [0, 1, 4], [0, 2, 3, 5, 6]
    rows = []
    for start in range(0, len(table), 20):
        part = table[start : start + 20]
        rows += rows_of(part[:, forces], [NAMES[0], NAMES[3]])
        rows += rows_of(part[::2, others], [NAMES[1], NAMES[2], NAMES[4], NAMES[5]])
    harness.send(rows)
    harness.intake.finish()
    found = [m for m in harness.strides() if not m.reasons]

    expected = {s.terminal_contact_s: s for s in measure(made) if s.valid}
    paired = [(m, expected[m.time_s]) for m in found if m.time_s in expected]
    assert len(paired) >= len(expected) - 3
    assert all(same(m, s) for m, s in paired)


def test_a_channel_that_falls_silent_is_waited_for_and_then_missing(made, table):
    harness = IntakeHarness()
    for start in range(0, len(table), 20):
        part = table[start : start + 20]
        harness.time.now_s += 0.1
        harness.intake.add_rows(rows_of(part[:, [0, 1, 4]], [NAMES[0], NAMES[3]]))
        names = NAMES[1:3] + NAMES[4:]
        kept = [0, 2, 3, 5, 6]
        if not 10 < start / 200 < 15:
            harness.intake.add_rows(rows_of(part[:, kept], names))
    harness.intake.finish()
    found = harness.strides()

    silent = [m for m in found if 11 < m.time_s < 14.8]
    assert len(silent) >= 6
    assert all("moment_lost" in m.reasons for m in silent)
    assert [m for m in found if m.time_s > 18 and not m.reasons]


def test_blank_cells_are_no_samples(made, table):
    rows = rows_of(table)
    for number, row in enumerate(rows):
        if number % 2:
            row |= {name: None for name in NAMES if "force" not in name}
    harness = IntakeHarness()
    harness.send(rows)
    harness.intake.finish()

    valid = [m for m in harness.strides() if not m.reasons]
    assert len(valid) >= sum(s.valid for s in measure(made)) - 3


def test_a_garbled_cell_costs_its_row_and_no_more(made, table):
    rows = rows_of(table)
    for number in range(5, len(rows), 50):
        rows[number] |= {NAMES[number % 3]: "ERR"}
    harness = IntakeHarness()
    harness.send(rows)
    harness.intake.finish()

    assert any("is 'ERR', which is no number." in text for text in harness.said)
    valid = [m for m in harness.strides() if not m.reasons]
    assert len(valid) >= sum(s.valid for s in measure(made)) - 3


def test_times_that_tell_no_rate_are_told_with_the_cure(made, table):
    harness = IntakeHarness()
    uneven_s = np.cumsum([0, *[0.01, 0.03] * 49, 0])  # as many steps of one length as of another
    some = table[:100].copy()
    some[:, 0] = uneven_s - 50
    harness.send(rows_of(some), chunk=100)
    assert harness.said[0].startswith("The times of the samples tell no rate. Give it with --rate.")
    harness.send(rows_of(table))  # and goes on
    harness.intake.finish()
    assert [m for m in harness.strides() if not m.reasons]


def one_of(*cells):
    return st.one_of(st.floats(-50, 900), st.sampled_from([None, math.nan, math.inf, *cells]))


odd_rows = st.lists(
    st.fixed_dictionaries(
        {},
        optional={
            "time_s": one_of("ERR", 1e12),
            "value": one_of("ERR"),
            **{name: one_of("ERR") for name in NAMES},
        },
    ),
    max_size=30,
)


@given(st.lists(odd_rows, max_size=5), st.sampled_from([None, 100.0]))
def test_nothing_that_comes_stops_it(batches, rate_hz):
    harness = IntakeHarness(rate_hz=rate_hz)
    for number in range(20):  # of samples, so that the rate and the legs are known
        times = [0.01 * (10 * number + k) for k in range(10)]
        harness.intake.add_rows([{"time_s": t, **dict.fromkeys(NAMES, 500.0)} for t in times])
    for batch in batches:
        harness.intake.add_rows(batch)
    harness.intake.finish()


def spoil(table, rows, columns, change):
    table = table.copy()
    first, last = np.searchsorted(table[:, 0], rows)
    table[first:last, columns] = change(table[first:last, columns])
    return table


def set_clock(table, by_s):
    return table + np.array([by_s, 0, 0, 0, 0, 0, 0])


FAULTS = {
    "gap": lambda t: np.delete(t, slice(2000, 2060), axis=0),
    "clock set back": lambda t: np.vstack((t[:2000], set_clock(t[2000:], -5.0))),
    "clock set forward": lambda t: np.vstack((t[:2000], set_clock(t[2000:], 500.0))),
    "every datagram twice": lambda t: np.repeat(t, 2, axis=0),
    "datagrams out of order": lambda t: np.vstack((t[:2000], t[2100:2200], t[2000:2100], t[2200:])),
    "dropped moment": lambda t: spoil(t, (10, 14), 2, lambda v: v * np.nan),
    "frozen angle": lambda t: spoil(t, (10, 14), 3, lambda v: v * 0 + 0.1),
    "force in kN": lambda t: spoil(t, (0, 99), 1, lambda v: v / 1000),
    "moment in Nmm": lambda t: spoil(t, (0, 99), 2, lambda v: v * 1000),
    "angle in degrees": lambda t: spoil(t, (0, 99), 3, np.degrees),
    "moment turned": lambda t: spoil(t, (0, 99), 2, lambda v: -v),
}


@pytest.mark.parametrize("fault", FAULTS)
def test_no_fault_shows_a_wrong_a2(made, table, fault):
    harness = IntakeHarness()
    harness.send(rows_of(FAULTS[fault](table)))
    harness.intake.finish()
    found = harness.strides()

    expected = [s for s in measure(made) if s.valid]
    truth = np.array([s.terminal_contact_s for s in expected])
    set_by = {"clock set back": -5.0, "clock set forward": 500.0}.get(fault, 0.0)
    jump_s = made.t_s[2000]
    times = [stride.time_s for stride in found]
    jump = next((i for i in range(1, len(times)) if not 0 <= times[i] - times[i - 1] < 9), 0)
    for place, stride in enumerate(found):
        if stride.reasons or stride.value is None:
            continue
        time_s = stride.time_s - (set_by if set_by and place >= jump else 0.0)
        nearest = int(np.abs(truth - time_s).argmin())
        assert abs(truth[nearest] - time_s) < 0.02, (time_s, jump_s)
        assert stride.value == pytest.approx(expected[nearest].a2_w_kg, rel=0.06)
    is_left_lost = fault in {"force in kN", "moment in Nmm", "angle in degrees", "moment turned"}
    if is_left_lost:
        assert not [m for m in found if m.side == Side.LEFT and not m.reasons]
    else:
        assert len([m for m in found if not m.reasons]) >= (0 if "twice" in fault else 40)
    assert fault in {"every datagram twice", "force in kN"} or any(m.reasons for m in found)


@pytest.mark.parametrize(
    ("rows", "cure"),
    [
        ([{"time_s": 1.0, "Fz": 2.0}], "--columns"),
        ([{"left_force_n": 1.0, "left_moment_nm": 1.0, "left_angle_rad": 1.0}], "time_s"),
        ([{"time_s": 1.0, "left_force_n": "high"}], "no number"),
        ([{"time_s": 1.7e12, "value": 3.0}], "in seconds"),
        ([{"value": 3.0, "side": "up"}], "left or right"),
        ([{"value": "good"}], "no number"),
        ([{"value": 3.0, "reason": "too{bad}"}], "A reason is a word"),
    ],
)
def test_rows_of_no_use_are_told_with_the_cure(rows, cure):
    harness = IntakeHarness()
    harness.send(rows * 50)

    assert harness.strides() == []
    assert len(harness.said) == 1  # not fifty times
    assert cure in harness.said[0]
    assert "50 rows not understood" in harness.intake.describe()


def test_milliseconds_are_noticed(table):
    harness = IntakeHarness()
    harness.send(rows_of(table * [1000, *[1] * 6]))

    assert harness.strides() == []
    assert any("milliseconds" in text and "t*0.001" in text for text in harness.said)


def test_units_and_signs_can_be_mapped(made, table):
    words = ["time=ms*0.001"]
    for side in ("left", "right"):
        words += [f"{side}.force={side}_Fz*1000", f"{side}.moment={side}_M*-1"]
        words += [f"{side}.angle={side}_deg*0.017453292519943295"]
    names = [f"{side}_{name}" for side in ("left", "right") for name in ("Fz", "M", "deg")]
    sent = table * [1000, *[0.001, -1, 180 / np.pi] * 2]
    harness = IntakeHarness(columns=read_column_map(words))
    harness.send([dict(zip(["ms", *names], row, strict=True)) for row in sent.tolist()])
    harness.intake.finish()

    valid = [m.value for m in harness.strides() if not m.reasons]
    assert valid == pytest.approx([s.a2_w_kg for s in measure(made) if s.valid], rel=1e-6)


async def test_no_body_mass_is_refused_with_the_cure(table):
    harness = IntakeHarness(mass_kg=None)
    harness.send(rows_of(table[:300]))

    with pytest.raises(ValueError, match="--mass 75"):
        await harness.intake.watch()
    assert harness.strides() == []


def test_what_is_kept_is_measured_alike(made, table, tmp_path):
    path = tmp_path / "kept.csv"
    harness = IntakeHarness(keep=path)
    harness.send(rows_of(table))
    harness.intake.finish()
    harness.intake.close()

    t_s, legs, *_ = read_signals(path)
    again = measure_strides(t_s, legs, rate_hz=200, mass_kg=MASS)
    live = [m.value for m in harness.strides() if not m.reasons]
    assert [s.a2_w_kg for s in again if s.valid] == pytest.approx(live, rel=1e-4)


def test_the_quality_line(table):
    harness = IntakeHarness()
    harness.intake.describe()
    rows = rows_of(np.delete(table, slice(1000, 1060), axis=0))
    harness.send(rows[:2000])
    harness.time.now_s += 10
    line = harness.intake.describe()

    assert (
        "200 samples/s, 1 times lost for up to 305 ms (look at network and recorder), lag" in line
    )
    assert "last stride" in line
    assert "10.0 s ago" in line
    harness.time.now_s += 5
    assert "no samples now" in harness.intake.describe()


def test_the_check_of_the_first_half_minute_is_told(made, table):
    harness = IntakeHarness(mass_kg=60.0)
    harness.send(rows_of(table))

    assert any("Check the body mass" in text for text in harness.said)


def test_extra_values_travel_as_far_as_they_can():
    harness = IntakeHarness()
    row = {"time_s": 5.0, "value": 3.5, "side": "R", "symmetry": 0.03, "belt speed": 1.0}
    harness.send([row | {"note": "tired", "nothing": None, "endless": float("inf")}])
    (stride,) = harness.strides()

    assert stride.extra == {"symmetry": 0.03}
    assert (stride.side, stride.value, stride.time_s) == (Side.RIGHT, 3.5, 5.0)
    assert "belt speed, note" in harness.said[0]


@pytest.mark.parametrize("begins_anew", [True, False])
def test_the_clock_that_is_told_follows_a_slow_sensor_and_one_that_begins_anew(begins_anew):
    harness = IntakeHarness()
    device_s = 0.0
    for _ in range(2000):  # an hour, by a clock that is 0.5 % slow
        harness.time.now_s += 1.8
        device_s += 1.8 * 0.995
        harness.intake.add_rows([{"time_s": device_s, "value": 4.0}])
    if begins_anew:
        harness.time.now_s += 20.0
        device_s = 1.0
        harness.intake.add_rows([{"time_s": device_s, "value": 4.0}])
    assert harness.feed.clock_s == pytest.approx(device_s, abs=0.1)


def knee_of(made, side):
    """Return the angle of a knee [rad] in a made walk, from contact to contact."""
    begins = [s.initial_contact_s for s in made.strides if s.side == side]
    stride = np.searchsorted(begins, made.t_s, side="right") - 1
    lengths = np.append(np.diff(begins), np.diff(begins)[-1])
    begin_s, length_s = np.array(begins)[stride], lengths[stride]
    share = np.clip((made.t_s - begin_s) / length_s, 0, 1)
    return np.interp(share, np.arange(100) / 100, SHAPES["knee angle"])


@pytest.mark.parametrize(
    ("mass_kg", "fault", "doubt"),
    [
        (MASS, "", None),
        (1.2 * MASS, "", "doubt_weight"),
        (MASS, "knee", "doubt_angle"),
        (MASS, "cane", "doubt_load"),
    ],
)
def test_strides_wait_for_a_person_where_no_stride_tells_what_is_wrong(mass_kg, fault, doubt):
    """After the check of the first half minute they do not count, until somebody has looked."""
    made = make_signals(list(walk(seed=4, strides=70)), MASS, Sensors(rate_hz=200), seed=4)
    both = (made.left, made.right)
    legs = [np.array([leg.force_n, leg.moment_nm, leg.angle_rad]) for leg in both]
    if fault == "cane":  # it carries an eighth of the weight while the right foot swings
        left, right = legs
        cane_n = MASS * 9.81 / 8 * (right[0] < 20)
        right[0] += cane_n
        left[:2] *= 1 - cane_n / np.maximum(left[0], 2 * cane_n + 1)
    if fault == "knee":
        for side, leg in zip(("left", "right"), legs, strict=True):
            leg[2] = knee_of(made, side)
    rows = rows_of(np.column_stack([made.t_s, *np.concatenate(legs)]))
    harness = IntakeHarness(mass_kg=mass_kg)
    harness.send(rows[: 45 * 200])
    before = harness.strides()
    harness.feed.resume()  # a connection that was lost, not a person
    harness.send(rows[45 * 200 : 55 * 200])
    waiting = harness.strides()
    harness.feed.pause()
    harness.feed.resume()
    harness.send(rows[55 * 200 :])
    after = harness.strides()

    early = [s for s in before if s.time_s < made.t_s[0] + 28]
    assert not any(reason.startswith("doubt") for s in early for reason in s.reasons)
    assert len(waiting) > 12
    if doubt is None:
        assert all(not s.reasons for s in waiting)
    else:
        assert all(s.reasons for s in waiting)
        assert (doubt,) in [s.reasons for s in waiting]
    assert not any(reason.startswith("doubt") for s in after for reason in s.reasons)
