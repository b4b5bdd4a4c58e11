"""Ankle moment and angle computed from plates and markers, against what the files' systems made."""

from dataclasses import dataclass, replace

import numpy as np
import pytest
from scipy.signal import butter, filtfilt

from rehab.gait import LegSamples, measure_strides
from rehab.gait.recordings import c3d_plates, inverse_dynamics
from rehab.gait.recordings.column_mapping import MARKED, find_layout, find_required, read_column_map
from rehab.gait.recordings.inverse_dynamics import JOINT_AHEAD_M, compute_ankle
from rehab.gait.recordings.markers import PLACES
from rehab.gait.recordings.readers import read_any_table
from rehab.gait.setup.check import check_setup
from tests.gait.corpus import HBM, PLUG_IN_GAIT, find_clean, open_corpus, own_legs, read_lab_file
from tests.sources.intake_harness import IntakeHarness
from tests.support.data import signals

ezc3d = pytest.importorskip("ezc3d")


@dataclass(frozen=True)
class Comparison:
    """Of clean strides: the moment's rms distance in stance [Nm/kg], the same with both below 6 Hz,
    and A2 by the file's own power and by its moment and angle (ratios).
    """

    rms: list[float]
    slow_rms: list[float]
    by_power: list[float]
    by_moment: list[float]


def compare(name: str) -> Comparison:
    walk = open_corpus(name)
    own = replace(walk, legs=own_legs(read_any_table(read_lab_file(PLUG_IN_GAIT[name]))))
    strides = own.measure()
    b, a = butter(2, 6 / (walk.rate_hz / 2))
    found = Comparison([], [], [], [])

    def rms(values):
        return float(np.sqrt(np.nanmean(values**2)))

    for one in find_clean(walk):
        part = slice(*np.searchsorted(walk.t_s, (one.begin_s, one.end_s)))
        theirs = np.asarray(walk.legs[one.side].moment_nm) / walk.mass_kg
        ours = np.asarray(own.legs[one.side].moment_nm) / walk.mass_kg
        found.rms.append(rms((ours - theirs)[part]))
        found.slow_rms.append(rms(filtfilt(b, a, np.nan_to_num(ours - theirs))[part]))
        ends = [abs(s.terminal_contact_s - one.end_s) if s.side == one.side else 9 for s in strides]
        a2 = strides[int(np.argmin(ends))].a2_w_kg
        found.by_power.append(a2 / one.file_a2_w_kg - 1)
        found.by_moment.append(a2 / one.a2_w_kg - 1)
    return found


@pytest.mark.parametrize(
    ("name", "by", "rms", "slow_rms", "by_power"),
    [  # medians, at most
        ("BTK motion3", "joints", 0.04, 0.03, 0.04),
        ("BTK flatfoot", "joints", 0.04, 0.03, 0.06),
        # Its own moment scatters by 0.1 Nm/kg about its own curve below 6 Hz.
        ("gaitalytics treadmill", "joints", 0.11, 0.04, 0.08),
        ("gaitalytics treadmill", "malleoli", 0.14, 0.09, 0.18),
        ("BTK motion3", "lateral", 0.07, 0.065, 0.08),
        ("BTK flatfoot", "lateral", 0.07, 0.065, 0.15),
        ("gaitalytics treadmill", "lateral", 0.16, 0.12, 0.23),
    ],
)
def test_against_the_files_own_moment_and_power(name, by, rms, slow_rms, by_power, monkeypatch):
    """By the file's joint centers, by both malleoli, and by the lateral one alone."""
    if by != "joints":
        monkeypatch.setattr(c3d_plates, "CENTERS", {})
    if by == "lateral":
        outer = {place: (names, ()) for place, (names, _) in PLACES.items()}
        monkeypatch.setattr(c3d_plates, "PLACES", outer)
    found = compare(name)
    print(
        f"\n{name}, {by}: {len(found.rms)} strides, moment {np.median(found.rms):.3f} Nm/kg rms "
        f"({np.median(found.slow_rms):.3f} below 6 Hz), A2 {np.median(found.by_power):+.1%} by the "
        f"file's power, {np.median(found.by_moment):+.1%} by its moment and angle"
    )
    assert np.median(found.rms) < rms
    assert np.median(found.slow_rms) < slow_rms
    assert abs(np.median(found.by_power)) < by_power


def find_frames(name):
    """Return of each clean stride what its file's own program wrote, frame by frame: the moment
    [Nm/kg] from contact to contact, and by how much its ground reaction force is off the plates'
    channels of the same file, without the ends of stance [N/kg].
    """
    walk, path = open_corpus(name), read_lab_file(PLUG_IN_GAIT[name])
    table, file = read_any_table(path), ezc3d.c3d(str(path))
    rate_hz = file["header"]["points"]["frame_rate"]
    apart = round(walk.rate_hz / rate_hz)
    for one in find_clean(walk):
        letter = one.side[0].upper()
        moment = np.nan_to_num(table[f"{letter}AnkleMoment.X"][::apart]) / 1000
        borne = np.nan_to_num(table[f"{letter}GroundReactionForce.Z"][::apart])
        off = borne - table[f"plates.{one.side}"][::apart] / walk.mass_kg
        first, stop = (round((at_s - walk.t_s[0]) * rate_hz) for at_s in (one.begin_s, one.end_s))
        fast = moment - filtfilt(*butter(2, 10 / (rate_hz / 2)), moment)
        yield fast[first:stop], off[first + 10 : stop - 10]


@pytest.mark.parametrize(
    ("name", "fast_nm_kg", "off_n_kg"),
    [
        ("BTK motion3", (0.0, 0.02), (0.0, 0.02)),
        ("BTK flatfoot", (0.0, 0.02), (0.0, 0.1)),
        # No moment of this file's plates comes within 0.08: it was computed from other samples.
        ("gaitalytics treadmill", (0.09, 0.13), (0.11, 0.14)),
    ],
)
def test_of_which_samples_a_file_has_its_moments(name, fast_nm_kg, off_n_kg):
    """Above 10 Hz walking leaves next to nothing of a moment: the rest is noise of its own."""
    frames = [[np.sqrt(np.mean(part**2)) for part in parts] for parts in find_frames(name)]
    fast, off = np.median(frames, axis=0)
    print(
        f"\n{name}: its moment above 10 Hz {fast:.3f} Nm/kg rms, its force off {off:.3f} N/kg rms"
    )
    assert fast_nm_kg[0] <= fast < fast_nm_kg[1]
    assert off_n_kg[0] <= off < off_n_kg[1]


@pytest.mark.parametrize(
    ("ahead_m", "foot_from", "rms", "by_power"),
    [
        (JOINT_AHEAD_M, "ankle", 0.11, 0.2),
        (0.0, "ankle", 0.05, 0.15),
        (0.0, "heel", 0.05, 0.05),
    ],
)
def test_against_a_model_whose_joint_is_the_malleolus(
    ahead_m, foot_from, rms, by_power, monkeypatch
):
    """HBM's subject 7 (``leg2d.m``): with its joint and its foot, from heel to toe, we agree."""
    raw = np.loadtxt(signals(HBM) / "rawdata.txt", comments="%").T
    walk = open_corpus("HBM subject 7")
    knee, malleolus, heel, toe = raw[5:7], raw[7:9], raw[9:11], raw[11:13]
    forward_n, up_n, moment_nm = raw[13:16]
    with np.errstate(divide="ignore", invalid="ignore"):
        cop_m = moment_nm / up_n
    monkeypatch.setattr(inverse_dynamics, "JOINT_AHEAD_M", ahead_m)
    tip = toe if foot_from == "ankle" else malleolus + toe - heel
    leg = dict(zip(MARKED, (up_n, forward_n, cop_m, *malleolus, *knee, *tip), strict=True))
    legs = {"right": LegSamples(up_n, *compute_ankle(leg))}
    strides = replace(walk, legs=legs).measure()
    off, ratios = [], []
    for one in find_clean(walk):
        part = slice(*np.searchsorted(walk.t_s, (one.begin_s, one.end_s)))
        both = (np.asarray(each["right"].moment_nm)[part] for each in (legs, walk.legs))
        off.append(np.sqrt(np.nanmean((next(both) - next(both)) ** 2)) / walk.mass_kg)
        (own,) = [s for s in strides if abs(s.terminal_contact_s - one.end_s) < 0.05]
        ratios.append(own.a2_w_kg / one.file_a2_w_kg - 1)
    print(
        f"\nfoot from {foot_from}: moment {np.median(off):.3f} Nm/kg, A2 {np.median(ratios):+.1%}"
    )
    assert np.median(off) < rms
    assert abs(np.median(ratios)) < by_power


def test_a_file_without_moments_is_measured_from_its_markers(tmp_path):
    """One command: plates and markers are enough."""
    table = read_any_table(read_lab_file(PLUG_IN_GAIT["BTK motion3"]))
    for name in [n for n in table if "Ankle" in n]:
        del table[name]
    check = check_setup(table)
    guesses = {key: guess.column for key, guess in check.proposal.guesses.items()}
    assert guesses["left", "moment"] == "own.left_moment_nm"
    assert guesses["right", "angle"] == "own.right_angle_rad"
    assert check.valid >= 2
    whole = check_setup(read_any_table(read_lab_file(PLUG_IN_GAIT["BTK motion3"])))
    assert whole.proposal.guesses["left", "moment"].column == "LAnkleMoment.X"


@pytest.mark.parametrize(
    ("name", "factor", "sides"),
    [
        *((name, factor, 2) for name in PLUG_IN_GAIT for factor in (0.5, 1.6)),
        *((name, 1.0, 0) for name in PLUG_IN_GAIT),
        ("gaitalytics treadmill", 1.2, 1),
        ("BTK motion3", 1.2, 2),
    ],
)
def test_an_angle_with_a_gain_is_told_where_joints_are_known(name, factor, sides):
    """People's own differ by 0.90 to 1.20 times, so that a gain of 1.2 is told of three in five."""
    table = read_any_table(read_lab_file(PLUG_IN_GAIT[name]))
    for column in [one for one in table if "AnkleAngles" in one and one.endswith(".X")]:
        table[column] = table[column] * factor
    told = [text for text in check_setup(table).findings if "times what the file's plates" in text]
    assert len([text for text in told if " angle is" in text]) == sides


@pytest.mark.parametrize("factor", [0.7376, 0.8, 1.0, 1.2])
@pytest.mark.parametrize("name", PLUG_IN_GAIT)
def test_a_moment_with_a_wrong_gain_is_told_by_plates_and_markers(name, factor):
    """lbf·ft for N·m, and gains that no stride shows: the lever on the force stays a foot's."""
    table = read_any_table(read_lab_file(PLUG_IN_GAIT[name]))
    for column in [one for one in table if one.endswith("AnkleMoment.X")]:
        table[column] = table[column] * factor
    check = check_setup(table)
    told = [text for text in check.findings if "times what the file's plates" in text]
    assert bool(told) == (factor != 1.0), told
    moments = [one for (_, channel), one in check.proposal.guesses.items() if channel == "moment"]
    assert {one.doubt for one in moments if not one.is_certain} == set(told)  # none is "sure"


@pytest.mark.parametrize(
    ("name", "column", "late_ms", "sides"),
    [
        *((name, "Moment", ms, 2) for name in PLUG_IN_GAIT for ms in (-10, 10)),
        *((name, "Angles", ms, 2) for name in PLUG_IN_GAIT for ms in (-20, 20)),
        ("BTK motion3", "Angles", -10, 2),
        ("gaitalytics treadmill", "Angles", -10, 0),  # its own come 5 to 9 ms late
        *((name, column, 0, 0) for name in PLUG_IN_GAIT for column in ("Moment", "Angles")),
    ],
)
def test_a_moment_or_angle_out_of_time_is_told_by_plates_and_markers(name, column, late_ms, sides):
    """No stride shows it, as people differ by more; the file's own markers do."""
    table = read_any_table(read_lab_file(PLUG_IN_GAIT[name]))
    time_s = table["time"]
    for one in [one for one in table if f"Ankle{column}" in one and one.endswith(".X")]:
        table[one] = np.interp(time_s - late_ms / 1000, time_s, table[one])
    told = [text for text in check_setup(table).findings if "markers make it" in text]
    assert len(told) == sides


def test_a_c3d_whose_second_axis_is_upward_gets_its_plates(tmp_path):
    path = read_lab_file(PLUG_IN_GAIT["BTK motion3"])
    file, turned = ezc3d.c3d(str(path)), tmp_path / "y_up.c3d"
    points = file["data"]["points"]
    points[:3] = points[[1, 2, 0]]  # x, y, z become z, x, y
    corners = file["parameters"]["FORCE_PLATFORM"]["CORNERS"]["value"]
    corners[:] = np.array(corners)[[1, 2, 0]]
    file.write(str(turned))
    expected, found = read_any_table(path), read_any_table(turned)
    for name in ("plates.left", "plates.right", "own.left_moment_nm", "own.left_angle_rad"):
        assert found[name] == pytest.approx(expected[name], abs=1e-3, nan_ok=True)


def write_type(file, kind):
    """Turn plates of type 2 into such that tell where a force presses, or of eight forces."""
    plates, analogs = file["parameters"]["FORCE_PLATFORM"], file["data"]["analogs"]
    places = np.array(plates["CHANNEL"]["value"]) - 1
    origins = np.array(plates["ORIGIN"]["value"])
    beside, before, below = 200.0, 120.0, 40.0  # mm
    for plate, (rows, (ox, oy, oz)) in enumerate(zip(places.T, origins.T, strict=True)):
        fx, fy, fz, mx, my, mz = analogs[0, rows]
        mx, my = mx + oy * fz - oz * fy, my + oz * fx - ox * fz  # at the surface
        if kind == 1:
            safe = np.where(np.abs(fz) > 5, fz, np.inf)
            analogs[0, rows] = fx, fy, fz, -my / safe, mx / safe, mz
            continue
        across, along = (mx + below * fy) / before, (my - below * fx) / beside
        signs = ((1, -1), (1, 1), (-1, 1), (-1, -1))
        corners = [(fz + a * across + b * along) / 4 for a, b in signs]
        added = np.array([[fx / 2, fx / 2, fy / 2, fy / 2, *corners]])
        file["data"]["analogs"] = np.concatenate([file["data"]["analogs"], added], axis=1)
        for name, text in (("LABELS", "k"), ("UNITS", "N"), ("DESCRIPTIONS", "")):
            texts = file["parameters"]["ANALOG"][name]["value"]
            texts += [f"{text}{plate}{n}" if name == "LABELS" else text for n in range(8)]
        for name, value in (("SCALE", 1.0), ("OFFSET", 0), ("GAIN", 1)):
            values = file["parameters"]["ANALOG"][name]
            values["value"] = np.append(values["value"], [value] * 8)
    count = analogs.shape[1]
    if kind == 3:
        plates["CHANNEL"]["value"] = np.arange(8 * places.shape[1]).reshape(-1, 8).T + count + 1
    depth = (0.0, 0.0, 0.0) if kind == 1 else (beside, before, -below)
    plates["ORIGIN"]["value"] = np.repeat(np.array([depth]).T, places.shape[1], axis=1)
    plates["TYPE"]["value"] = np.full(places.shape[1], kind)


@pytest.mark.parametrize("kind", [1, 3])
def test_plates_of_other_types_come_to_the_same(kind, tmp_path):
    path = read_lab_file(PLUG_IN_GAIT["BTK motion3"])
    file, other = ezc3d.c3d(str(path)), tmp_path / "other.c3d"
    write_type(file, kind)
    del file["data"]["meta_points"]
    file.write(str(other))
    expected, found = read_any_table(path), read_any_table(other)
    for name in ("plates.left", "plates.right", "own.left_moment_nm", "own.right_moment_nm"):
        bearing = expected[f"plates.{'left' if 'left' in name else 'right'}"] > 100
        assert found[name][bearing] == pytest.approx(expected[name][bearing], abs=0.05, nan_ok=True)


def sagittal_rows(count=400, rate_hz=100.0):
    """Return a leg of known statics: the foot tips about its toe under a leaning force."""
    t_s = np.arange(count) / rate_hz
    rows = {
        "force": 300 + 50 * np.sin(t_s),
        "forward": 40 * np.cos(t_s),
        "cop": 0.1 + 0.02 * t_s,
        "ankle_forward": 0.05 * np.sin(t_s),
        "ankle_up": 0.08 + 0.01 * t_s,
        "knee_forward": 0.05 * np.sin(t_s) + 0.4 * np.sin(0.3 * t_s),
        "knee_up": 0.08 + 0.01 * t_s + 0.4 * np.cos(0.3 * t_s),
        "toe_forward": 0.05 * np.sin(t_s) + 0.15 * np.cos(0.2 * t_s),
        "toe_up": 0.08 + 0.01 * t_s - 0.15 * np.sin(0.2 * t_s),
    }
    return t_s, rows


def test_moment_and_angle_by_hand():
    t_s, leg = sagittal_rows()
    moment, angle = compute_ankle(leg)
    lever = leg["cop"] - leg["ankle_forward"] - JOINT_AHEAD_M
    assert moment == pytest.approx(lever * leg["force"] + leg["ankle_up"] * leg["forward"])
    # The shank leans forward by 0.3 rad/s and the foot plantarflexes by 0.2 rad/s.
    assert angle == pytest.approx(np.pi / 2 - 0.3 * t_s + 0.2 * t_s)


def test_columns_of_markers_take_the_place_of_moment_and_angle():
    names = [
        f"left_{name}_n" if name in {"force", "forward"} else f"left_{name}_m" for name in MARKED
    ]
    assert find_required(MARKED) == MARKED
    assert find_required((*MARKED, "moment", "angle")) == ("force", "moment", "angle")
    assert set(find_layout(["time_s", *names]).legs["left"]) == set(MARKED)
    with pytest.raises(ValueError, match=r"no toe_up\. Map left\.toe_up=COLUMN"):
        read_column_map(["time=t", *(f"left.{name}=c" for name in MARKED[:-1])])


@pytest.mark.parametrize("chunk", [7, 50])
def test_streamed_markers_give_the_strides_of_the_file(chunk, tmp_path):
    """By frame: the same numbers, whatever the chunks."""
    walk = open_corpus("BTK motion3")
    table = read_any_table(read_lab_file(PLUG_IN_GAIT["BTK motion3"]))
    legs = own_legs(table)
    expected = measure_strides(
        walk.t_s, legs, rate_hz=1000.0, mass_kg=74.0, look_ahead_s=0.05, is_overground=True
    )
    # A leg whose moment and angle come out as those: a foot of 1 m that turns about a fixed ankle.
    rows = {"time_s": walk.t_s}
    for side, leg in legs.items():
        up = np.asarray(leg.force_n)
        moment, angle = np.asarray(leg.moment_nm), np.asarray(leg.angle_rad)
        with np.errstate(divide="ignore", invalid="ignore"):
            cop = np.where(up >= 40, moment / up, 0.0) + JOINT_AHEAD_M
        still = np.zeros(len(up))
        values = (up, still, cop, still, still, still, still + 1, np.sin(angle), np.cos(angle))
        for name, value in zip(MARKED, values, strict=True):
            unit = "n" if name in {"force", "forward"} else "m"
            rows[f"{side}_{name}_{unit}"] = value
    harness = IntakeHarness(mass_kg=74.0, rate_hz=1000.0, is_overground=True, keep=tmp_path / "k")
    columns = np.column_stack(list(rows.values()))
    harness.send([dict(zip(rows, row, strict=True)) for row in columns.tolist()], chunk)
    harness.intake.finish()
    harness.intake.close()
    found = harness.strides()
    assert [one.reasons for one in found] == [one.reasons for one in expected]
    assert [one.value for one in found] == pytest.approx(
        [one.a2_w_kg for one in expected], rel=1e-6
    )
    assert {"left_cop_m", "left_moment_nm"} <= set((tmp_path / "k").read_text()[:600].split(","))
