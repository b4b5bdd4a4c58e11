"""Files that cannot be used: every message says where, what and how to cure it."""

import os
import re

import pytest

from rehab.sources.recording import RecordingError, parse_recording, read_recording, reading


def refuse(parse, text: str, *parts: str) -> None:
    """Check that a text is refused with a message that has all these parts."""
    with pytest.raises(RecordingError) as refusal:
        parse(text)
    for part in parts:
        assert part in str(refusal.value)


def test_missing_file(tmp_path):
    with pytest.raises(RecordingError, match=r"There is no recording .*walk\.csv. Check the path"):
        read_recording(tmp_path / "walk.csv")


def test_directory(tmp_path):
    with pytest.raises(RecordingError, match="is not a file. Name a CSV file"):
        read_recording(tmp_path)


@pytest.mark.parametrize("path", ["x" * 5000, "a\0b", ""])
def test_impossible_path(path):
    with pytest.raises(RecordingError):
        read_recording(path)


def test_a_name_that_is_no_text(tmp_path):
    path = tmp_path / os.fsdecode(b"walk\xff.csv")
    with pytest.raises(
        RecordingError, match="There is no recording .*walk\N{REPLACEMENT CHARACTER}"
    ):
        read_recording(path)
    try:
        path.write_text("time_s,value\n0,3\n", "utf-8")
    except OSError:
        pytest.skip("this file system takes text only")
    assert read_recording(path).name == "walk\N{REPLACEMENT CHARACTER}.csv"


def test_huge_file(tmp_path, monkeypatch):
    monkeypatch.setattr(reading, "MAX_BYTES", 10)
    path = tmp_path / "walk.csv"
    path.write_text("time_s,value\n0,3\n", "utf-8")

    with pytest.raises(RecordingError, match=r"walk\.csv is larger than .* Split it"):
        read_recording(path)


@pytest.mark.parametrize("text", ["", "\n", "\r\n\r\n", " ", ",,,\n,,\n", "\ufeff"])
def test_empty_file(parse, text):
    refuse(parse, text, "Recording walk.csv is empty. Export it again.")


def test_blank_header(parse):
    refuse(parse, "\ntime_s,value\n0,3\n", "Row 1 of recording walk.csv is blank.")


@pytest.mark.parametrize("text", ["time_s,value", "time_s,value\n", "time_s,value\n,\n\n"])
def test_header_only(parse, text):
    refuse(parse, text, "Recording walk.csv has a header but no strides.")


@pytest.mark.parametrize(
    ("header", "missing"),
    [
        ("Step Count,A2_Success,iVGRF_max", "no column iA2."),
        ("Task,ExpTime,iStrideCt,iStrideLeg,iStrideUse,iA2_Actual", "no columns iA2_Target, iA2_"),
        ("time_s,force", "no column value."),
        ("a,b,c", "no columns time_s, value."),
    ],
)
def test_missing_columns_are_those_of_the_nearest_layout(parse, header, missing):
    refuse(
        parse,
        header + "\n" + "1," * header.count(",") + "1\n",
        "Recording walk.csv has ",
        missing,
        "Known layouts: hebb03, hebb91, plain.",
    )


def test_duplicate_columns(parse):
    refuse(parse, "time_s,value,value\n0,1,2\n", "has 2 columns named 'value'. Keep one")


def test_column_without_name(parse):
    refuse(parse, "time_s,value,\n0,1,2\n", "Column 3 of recording walk.csv has no name in row 1.")


@pytest.mark.parametrize(("row", "cells"), [("0", 1), ("0,1,2", 3), ("0,68,1,95", 4)])
def test_rows_with_too_few_or_too_many_cells(parse, row, cells):
    refuse(
        parse,
        f"time_s,value\n0,3\n{row}\n",
        f"Row 3 of recording walk.csv: {cells} cells where the header has 2.",
        "semicolons",
    )


def test_blank_row_in_the_middle(parse):
    refuse(parse, "time_s,value\n0,3\n\n1,3\n", "Row 3 ", "the row is blank. Delete it")


@pytest.mark.parametrize(
    "cell", ["abc", "3.5 W/kg", "1_000", "0x10", "１", "--1", "1e", "12:30", "+-inf", ".", "NA"]
)
def test_text_in_a_number(parse, hebb03, cell):
    refuse(
        parse,
        hebb03({}, {"iA2_Actual": cell}),
        f"Row 3 of recording walk.csv, column iA2_Actual: {cell!r} is not a number. Write one",
        "or leave the cell blank.",
    )


@pytest.mark.parametrize("column", ["iA2_Target", "iA2_Decr", "iHS2", "ExpTime", "iStrideCt"])
def test_every_column_that_is_read_is_checked(parse, hebb03, column):
    refuse(parse, hebb03({}, {column: "x"}), "Row 3 ", f"column {column}: 'x' is not a number.")


def test_text_in_an_extra_column(parse):
    refuse(parse, "time_s,value,remark\n0,3,good\n", "Row 2 ", "column remark: 'good' is not a nu")


@pytest.mark.parametrize("cell", ["NaN", "", "inf", "-inf", "1e999"])
def test_time_must_be_finite(parse, hebb03, cell):
    refuse(
        parse,
        hebb03({}, {"ExpTime": cell}),
        f"Row 3 of recording walk.csv, column ExpTime: {cell!r} is no finite number.",
    )


def test_absurd_time(parse, hebb03):
    refuse(parse, hebb03({"ExpTime": "1e300"}), "Row 2 ", "column ExpTime: 1e+300 is no time")


def test_time_going_back(parse):
    refuse(
        parse,
        "time_s,value\n0,3\n2.0000001,3\n2,3\n",
        "Row 4 of recording walk.csv, column time_s: time goes back from 2.0000001 s to 2.0 s.",
        "Sort the rows",
    )


def test_time_may_stand_still(parse):
    assert len(parse("time_s,value\n0,3\n0,3\n").strides) == 2


@pytest.mark.parametrize(
    ("numbers", "message"),
    [
        ((1, 2, 2), "Row 4 of recording walk.csv, column iStrideCt: stride number 2 follows 2"),
        ((1, 3, 2), "Row 3 of recording walk.csv, column iStrideCt: stride number 3 follows 1"),
        ((1, 2, 4), "stride number 4 follows 2, where 3 is due"),
        ((2, 3, 4), "Row 2 of recording walk.csv, column iStrideCt: stride number 2 comes first"),
        ((0, 1, 2), "stride number 0 comes first, where 1 is due"),
        ((1, -2, 3), "stride number -2 follows 1"),
    ],
)
def test_repeated_lost_and_shuffled_rows(parse, hebb03, numbers, message):
    refuse(parse, hebb03(*({"iStrideCt": n} for n in numbers)), message, "sort the rows")


@pytest.mark.parametrize("cell", ["1.5", "1e300"])
def test_stride_numbers_are_whole(parse, hebb03, cell):
    refuse(parse, hebb03({"iStrideCt": cell}), "column iStrideCt: ", "is no whole number")


@pytest.mark.parametrize("column", ["iStrideUse", "iA2_Success"])
@pytest.mark.parametrize("cell", ["2", "yes", "0.5"])
def test_flags_are_1_or_0(parse, hebb03, column, cell):
    refuse(parse, hebb03({column: cell}), f"column {column}: '{cell}' is neither 1 nor 0. Write 1")


def test_use_must_be_said(parse, hebb03):
    refuse(parse, hebb03({"iStrideUse": "NaN"}), "Row 2 ", "column iStrideUse: blank. Write 1")


@pytest.mark.parametrize("cell", ["", "B", "left leg"])
def test_unknown_leg(parse, hebb03, cell):
    refuse(parse, hebb03({"iStrideLeg": cell}), f"column iStrideLeg: {cell!r} is no leg. Write L")


@pytest.mark.parametrize("task", ["", "Rest", "SSWS_1A2", "SSWS_85", "SSWS_٨٥A2"])
def test_unknown_task(parse, hebb03, task):
    refuse(
        parse,
        hebb03({}, {"Task": task}),
        f"Row 3 of recording walk.csv, column Task: the task {task!r} is not known. Known tasks: ",
    )


@pytest.mark.parametrize("task", ["SSWS_49A2", "SSWS_151A2", "SSWS_00A2"])
def test_gain_out_of_bounds_in_task(parse, hebb03, task):
    refuse(parse, hebb03({"Task": task}), "Row 2 ", "column Task: A gain of ", "from 0.5 to 1.5")


@pytest.mark.parametrize("gain", ["0", "2", "-1", "inf"])
def test_gain_out_of_bounds(parse, gain):
    refuse(parse, f"time_s,value,gain\n0,3,{gain}\n", "Row 2 ", "column gain: A gain of ")


@pytest.mark.parametrize(
    ("header", "cell"), [("kind", "sprint"), ("kind", ""), ("phase", "baseline"), ("kind", "Catch")]
)
def test_phase_kind_must_be_known(parse, header, cell):
    refuse(parse, f"time_s,value,{header}\n0,3,{cell}\n", "column kind: ", "Write one of baseline,")


@pytest.mark.parametrize("goal", ["0", "-1", "inf"])
def test_impossible_goal(parse, hebb03, goal):
    refuse(parse, hebb03({"iA2_Target": goal}), "column iA2_Target: ", "cannot be a goal")


@pytest.mark.parametrize(
    ("goal", "change"),
    [("3.9000001", "from 3.9 to 3.9000001"), ("", "from 3.9 to blank"), ("NaN", "from 3.9 to bla")],
)
def test_goal_must_be_constant(parse, hebb03, goal, change):
    refuse(
        parse,
        hebb03({}, {}, {"iA2_Target": goal}),
        "Row 4 of recording walk.csv, column iA2_Target: the goal changes ",
        change,
    )


def test_a_goal_may_be_left_out(parse, hebb03):
    assert parse(hebb03({"iA2_Target": ""}, {"iA2_Target": "NaN"})).goal is None


@pytest.mark.parametrize("reason", ["Bad", "bad!", "ü", "1st"])
def test_reason_codes(parse, reason):
    refuse(parse, f"time_s,value,reason\n0,3,{reason}\n", "Row 2 ", "is no reason code")


def test_valid_with_a_reason(parse):
    refuse(parse, "time_s,value,valid,reason\n0,3,1,flagged\n", "a valid stride has no reason.")


def test_unclosed_quotation_mark(parse):
    refuse(parse, 'time_s,value\n0,3\n1,"3\n2,3\n', "Row 3 ", "cannot be read", "Close every quota")


@pytest.mark.parametrize("size", [201, 200_000])
def test_huge_cells(parse, size):
    refuse(parse, f"time_s,value\n0,{'1' * size}\n", "Row 2 ")
    refuse(parse, f"time_s,value,{'x' * size}\n0,1,2\n")


@pytest.mark.long
def test_endless_rows(parse):
    refuse(parse, "\n" * 250_000, "has more than 200000 rows. Split it")


def test_messages_stay_short_and_harmless(parse):
    with pytest.raises(RecordingError) as refusal:
        parse("time_s,value\n0,\x1b[31m" + "x" * 190 + "\n")
    assert len(str(refusal.value)) < 200
    assert "\x1b" not in str(refusal.value)


UNREADABLE = {
    "latin-1": "time_s,value,größe\n0,3,1\n".encode("latin-1"),
    "UTF-16 without mark": "time_s,value\n0,3\n".encode("utf-16-le"),
    "half UTF-16": "time_s,value\n0,3\n".encode("utf-16")[:-1],
    "NUL": b"time_s,value\n0,\x003\n",
    "spreadsheet": b"PK\x03\x04\x14\x00\x06\x00\xff\xfe",
    "UTF-32": "time_s,value\n0,3\n".encode("utf-32"),
}


@pytest.mark.parametrize("data", UNREADABLE.values(), ids=UNREADABLE)
def test_unreadable_encoding(data):
    with pytest.raises(RecordingError, match=re.escape('save it as "CSV UTF-8"')):
        parse_recording(data, "walk.csv")


@pytest.mark.parametrize("encoding", ["utf-8", "utf-8-sig", "utf-16"])
def test_readable_encodings(encoding):
    data = "time_s,value,größe\n0,3,1\n".encode(encoding)

    (stride,) = parse_recording(data, "walk.csv").strides

    assert stride.measurement.extra == {"größe": 1}


GOOD = "time_s,value,kind\n0.5,3,catch\n1.5,3.25,catch\n"
WRITTEN = {
    "Windows lines": GOOD.replace("\n", "\r\n"),
    "old Mac lines": GOOD.replace("\n", "\r"),
    "no last line end": GOOD.removesuffix("\n"),
    "blank end": GOOD + "\n\n,,\n",
    "blanks": GOOD.replace(",", " , "),
    "quotes": 'time_s,"value",kind\n"0.5",3,catch\n1.5,"3.25","catch"\n',
    "semicolons": GOOD.replace(",", ";"),
    "decimal commas": GOOD.replace(",", ";").replace(".", ","),
    "tabs": GOOD.replace(",", "\t"),
    "tabs and decimal commas": GOOD.replace(",", "\t").replace(".", ","),
}


@pytest.mark.parametrize("text", WRITTEN.values(), ids=WRITTEN)
def test_ways_of_writing_the_same(parse, text):
    assert parse(text) == parse(GOOD)


def test_decimal_mark_must_not_change(parse):
    refuse(
        parse,
        "time_s;value\n0,5;3\n1.500;3\n",
        "Row 3 of recording walk.csv, column time_s: '1.500' is not a number. Write one, with a ",
        "decimal comma as elsewhere in this file",
    )


def test_nothing_is_given_where_the_last_row_is_bad(parse, hebb03):
    refuse(parse, hebb03(*[{}] * 50, {"iA2_Actual": "x"}), "Row 52 ")
