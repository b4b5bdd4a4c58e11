"""Whatever a file holds, it is read or refused; what was written is read back."""

import csv
import io
import math

from hypothesis import example, given, settings
from hypothesis import strategies as st

from rehab.sources.recording import (
    LAYOUTS,
    RecordedStride,
    Recording,
    RecordingError,
    parse_recording,
)
from rehab.training.phases import PHASE_KINDS, Phase
from rehab.training.steps import Measurement, Side

unhurried = settings(deadline=None)  # machines that test several things at once may stall
COLUMNS = sorted(
    {
        column
        for layout in LAYOUTS.values()
        for column in (*layout.required, *layout.other, "number", "side", "goal", "shown", "hit")
    }
)


def read_or_refuse(data: bytes, layout: str | None = None) -> None:
    """Read, and check the little that holds for any recording."""
    try:
        recording = parse_recording(data, "walk.csv", layout)
    except RecordingError as refusal:
        assert str(refusal)
        return
    assert [m.number for m in recording] == list(range(1, len(recording.strides) + 1))
    assert sum(phase.strides or 0 for phase in recording.phases) == len(recording.strides)


@unhurried
@given(st.binary(), st.sampled_from([None, *LAYOUTS, "x"]))
@example(b"\xff\xfe", None)
def test_any_bytes_are_read_or_refused(data, layout):
    read_or_refuse(data, layout)


@unhurried
@given(st.text(), st.sampled_from(["utf-8", "utf-8-sig", "utf-16"]))
def test_any_text_is_read_or_refused(text, encoding):
    read_or_refuse(text.encode(encoding, errors="surrogatepass"))


CELLS = (
    st.sampled_from(
        [
            "",
            "0",
            "1",
            "2",
            "L",
            "R",
            "NaN",
            "inf",
            "-1",
            "1e308",
            "3.5",
            "1,5",
            "SSWS",
            "SSWS_85A2",
        ]
    )
    | st.floats().map(str)
    | st.text(max_size=5)
)


@unhurried
@given(st.data(), st.sampled_from([*LAYOUTS]), st.sampled_from([",", ";", "\t"]))
def test_any_cells_under_a_known_header_are_read_or_refused(data, layout, delimiter):
    more = data.draw(st.lists(st.sampled_from(COLUMNS), max_size=4))
    header = list(dict.fromkeys([*LAYOUTS[layout].required, *more]))
    rows = data.draw(
        st.lists(st.lists(CELLS, min_size=len(header), max_size=len(header)), max_size=4)
    )
    text = io.StringIO()
    csv.writer(text, delimiter=delimiter).writerows([header, *rows])

    read_or_refuse(text.getvalue().encode(errors="surrogatepass"), layout)


VALUES = st.none() | st.floats(allow_nan=False)
NAMES = st.text("abcdefgh ,;\"'äö日", min_size=1, max_size=12).map(str.strip).filter(bool)
EXTRA_COLUMNS = ("slope_deg", "belt, m/s", "größe")


@st.composite
def recordings(draw) -> Recording:
    """Draw a recording as it would be read back from a plain file."""
    drawn = draw(
        st.lists(
            st.builds(
                Phase,
                kind=st.sampled_from([*PHASE_KINDS]),
                name=NAMES,
                feedback=st.booleans(),
                gain=st.floats(0.5, 1.5),
                strides=st.integers(1, 4),
            ),
            min_size=1,
            max_size=4,
            unique_by=lambda phase: phase.name,
        )
    )
    places = [place for place, phase in enumerate(drawn) for _ in range(phase.strides or 0)]
    times = sorted(draw(st.lists(st.floats(-1e6, 1e9), min_size=len(places), max_size=len(places))))
    side = draw(st.sampled_from(Side))
    reasons = st.lists(st.sampled_from(["flagged", "force_lost", "x_1"]), max_size=2)
    extra = st.dictionaries(
        st.sampled_from(EXTRA_COLUMNS), st.floats(allow_nan=False, allow_infinity=False)
    )
    strides = tuple(
        RecordedStride(
            row=number + 1,
            measurement=Measurement(
                number, time_s, side, draw(VALUES), tuple(draw(reasons)), draw(extra)
            ),
            phase=place,
            recorded_shown=draw(VALUES),
            recorded_hit=draw(st.none() | st.booleans()),
        )
        for number, (place, time_s) in enumerate(zip(places, times, strict=True), start=1)
    )
    goal = draw(st.none() | st.floats(0, exclude_min=True, allow_infinity=False))
    return Recording("walk.csv", "plain", side, tuple(drawn), goal, strides)


def write_plain(recording: Recording, delimiter: str, decimal_comma: bool) -> str:
    """Write a recording as docs/recordings.md says."""
    text = io.StringIO()
    writer = csv.writer(text, delimiter=delimiter)
    writer.writerow(
        [
            *("time_s", "value", "number", "side", "valid", "reason"),
            *("phase", "kind", "feedback", "gain", "goal", "shown", "hit"),
            *EXTRA_COLUMNS,
        ]
    )

    def mark(number: float | None) -> str:
        written = "" if number is None else repr(number)
        return written.replace(".", ",") if decimal_comma else written

    for stride in recording.strides:
        m = stride.measurement
        phase = recording.phases[stride.phase]
        hit = "" if stride.recorded_hit is None else int(stride.recorded_hit)
        writer.writerow(
            [mark(m.time_s), mark(m.value), m.number, m.side, int(not m.reasons)]
            + [" ".join(m.reasons), phase.name, phase.kind, phase.feedback, mark(phase.gain)]
            + [mark(recording.goal), mark(stride.recorded_shown), hit]
            + [mark(m.extra.get(column)) for column in EXTRA_COLUMNS]
        )
    return text.getvalue()


@unhurried
@given(
    recordings(),
    st.sampled_from([(",", False), (";", False), (";", True), ("\t", True)]),
    st.sampled_from(["utf-8", "utf-8-sig", "utf-16"]),
)
def test_what_was_written_is_read_back(recording, marks, encoding):
    text = write_plain(recording, *marks)

    assert parse_recording(text.encode(encoding), "walk.csv") == recording


@unhurried
@given(recordings(), st.data())
def test_a_changed_flag_changes_that_flag_only(recording, data):
    place = data.draw(st.integers(0, len(recording.strides) - 1))
    lines = list(csv.reader(io.StringIO(write_plain(recording, ",", decimal_comma=False))))
    column = lines[0].index("hit")
    lines[place + 1][column] = "0" if recording.strides[place].recorded_hit else "1"
    text = io.StringIO()
    csv.writer(text).writerows(lines)

    changed = parse_recording(text.getvalue().encode(), "walk.csv")

    differing = [
        index
        for index, (now, then) in enumerate(zip(changed.strides, recording.strides, strict=True))
        if now != then
    ]
    assert differing == [place]


@unhurried
@given(st.floats())
def test_any_value_is_passed_on_as_it_is(value):
    recording = parse_recording(f"time_s,value\n0,{value!r}\n".encode(), "walk.csv")

    read = recording.strides[0].measurement.value
    assert read is None if math.isnan(value) else read == value
