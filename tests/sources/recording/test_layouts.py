"""What the three layouts make of a row."""

import re
from pathlib import Path

import pytest

from rehab.sources.recording import LAYOUTS, RecordingError, read_recording
from rehab.training.measures import A2
from rehab.training.phases import PHASE_KINDS, Phase
from rehab.training.steps import Measurement, Side, find_invalid_reasons

HEBB91 = "Step Count,iA2,A2_Success,iVGRF_max,iSL\n"


def test_hebb03_stride(parse, hebb03):
    recording = parse(hebb03({}, {"iA2_Decr": 3.4, "iA2_Success": 0}))

    assert recording.layout == "hebb03"
    assert recording.trained_side is Side.LEFT
    assert recording.goal == 3.9
    stride = recording.strides[1]
    assert (stride.row, stride.phase) == (3, 0)
    assert stride.measurement == Measurement(
        2, 2.16, Side.LEFT, 4.0, (), {"iHS2": 1.08, "iGRF_AP_propel": 1.5}
    )
    assert (stride.recorded_shown, stride.recorded_hit) == (3.4, False)


@pytest.mark.parametrize(
    ("task", "kind", "feedback", "gain"),
    [
        ("SSWS", "baseline", False, 1.0),
        ("SSWS_Fam", "familiarization", True, 1.0),
        ("SSWS_100A2", "training", True, 1.0),
        ("SSWS_95A2", "training", True, 0.95),
        ("SSWS_90A2", "training", True, 0.90),
        ("SSWS_85A2", "training", True, 0.85),
        ("FWS_110A2", "training", True, 1.10),
        ("SSWS_Catch", "catch", False, 1.0),
        ("SSWS_WO", "washout", False, 1.0),
    ],
)
def test_hebb03_task_is_a_phase(parse, hebb03, task, kind, feedback, gain):
    (phase,) = parse(hebb03({"Task": task}, {"Task": task})).phases

    assert phase == Phase(kind, task, feedback, gain, strides=2)


def test_runs_of_one_task_are_phases(parse, hebb03):
    tasks = ["SSWS", "SSWS_Catch", "SSWS_Catch", "SSWS_85A2", "SSWS_Catch"]

    recording = parse(hebb03(*({"Task": task} for task in tasks)))

    assert [(p.name, p.strides) for p in recording.phases] == [
        ("SSWS", 1),
        ("SSWS_Catch", 2),
        ("SSWS_85A2", 1),
        ("SSWS_Catch", 1),
    ]
    assert [stride.phase for stride in recording.strides] == [0, 1, 1, 2, 3]


def test_phases_at_gain_one_differ_in_gain_only(parse, hebb03):
    recording = parse(hebb03({}, {"Task": "SSWS_85A2"}))

    assert [phase.gain for phase in recording.phases] == [1.0, 0.85]
    assert [phase.gain for phase in recording.phases_at_gain_one()] == [1.0, 1.0]
    assert [p.name for p in recording.phases_at_gain_one()] == ["SSWS", "SSWS_85A2"]


@pytest.mark.parametrize(
    ("cell", "value", "reasons"),
    [
        ("NaN", None, ("missing",)),
        ("nan", None, ("missing",)),
        ("", None, ("missing",)),
        ("Inf", float("inf"), ("not_finite",)),
        ("-inf", float("-inf"), ("not_finite",)),
        ("1e999", float("inf"), ("not_finite",)),
        ("-0.5", -0.5, ("out_of_bounds",)),
        ("1e308", 1e308, ("out_of_bounds",)),
        ("+4.", 4.0, ()),
        (".5E1", 5.0, ()),
    ],
)
def test_odd_values_are_passed_on_for_scoring_to_judge(parse, hebb03, cell, value, reasons):
    (stride,) = parse(hebb03({"iA2_Actual": cell})).strides

    assert stride.measurement.value == value
    assert find_invalid_reasons(stride.measurement, A2) == reasons


def test_flagged_stride_keeps_its_value(parse, hebb03):
    (stride,) = parse(hebb03({"iStrideUse": 0, "iA2_Actual": 9.9})).strides

    assert stride.measurement.value == 9.9
    assert stride.measurement.reasons == ("flagged",)


def test_what_was_not_recorded_is_unknown(parse, hebb03):
    text = hebb03({"iA2_Decr": "NaN", "iA2_Success": "NaN", "iHS2": "NaN", "iGRF_AP_propel": "inf"})

    (stride,) = parse(text).strides

    assert (stride.recorded_shown, stride.recorded_hit) == (None, None)
    assert stride.measurement.extra == {}


def test_hebb91_has_neither_time_nor_leg_nor_goal(parse):
    recording = parse(HEBB91 + "1,2.1,0,10,0.5\n2,2.7,1,10,0.5\n3,2.6,1,10,-0.04\n")

    assert recording.layout == "hebb91"
    assert recording.trained_side is None
    assert recording.goal is None
    assert recording.phases == (Phase("training", "Training", True, strides=3),)
    assert [m.time_s for m in recording] == pytest.approx([0, 1.10, 2.20])
    assert [stride.recorded_hit for stride in recording.strides] == [False, True, True]
    assert recording.strides[2].measurement.extra == {"iVGRF_max": 10, "iSL": -0.04}


@pytest.mark.parametrize(
    ("force", "reasons"),
    [("2.45", ()), ("2.449", ("force_lost",)), ("0", ("force_lost",)), ("NaN", ("force_lost",))],
)
def test_hebb91_contact_without_force_is_no_step(parse, force, reasons):
    (stride,) = parse(HEBB91 + f"1,2.1,0,{force},0.5\n").strides

    assert stride.measurement.reasons == reasons
    assert stride.measurement.value == 2.1


def test_plain_needs_time_and_value_only(parse):
    recording = parse("time_s,value\n0,3.5\n1.1,\n")

    assert recording.layout == "plain"
    assert recording.phases == (Phase("training", "Training", True, strides=2),)
    assert list(recording) == [
        Measurement(1, 0.0, Side.LEFT, 3.5),
        Measurement(2, 1.1, Side.LEFT, None),
    ]


def test_plain_phase_takes_what_is_given_and_its_kind_s_defaults(parse):
    recording = parse(
        "time_s,value,kind,phase,feedback,gain\n"
        "0,3,baseline,,,\n"
        "1,3,training,Push,,0.9\n"
        "2,3,training,Push,0,0.9\n"
        '3,3,catch,"Calm, now",1,\n'
    )

    assert recording.phases == (
        Phase("baseline", "Baseline", False, 1.0, 1),
        Phase("training", "Push", True, 0.9, 1),
        Phase("training", "Push", False, 0.9, 1),
        Phase("catch", "Calm, now", True, 1.0, 1),
    )


@pytest.mark.parametrize("kind", PHASE_KINDS)
def test_plain_knows_every_phase_kind(parse, kind):
    assert parse(f"time_s,value,kind\n0,3,{kind}\n").phases[0].kind == kind


@pytest.mark.parametrize(
    ("valid", "reason", "value", "reasons"),
    [
        ("1", "", "3", ()),
        ("", "", "3", ()),
        ("0", "", "3", ("flagged",)),
        ("False", "force_lost wobble", "3", ("force_lost", "wobble")),
        ("", "force_lost", "3", ("force_lost",)),
        ("0", "missing", "", ("missing",)),
        ("0", "missing", "3", ("missing",)),
        ("0", "flagged missing", "", ("flagged", "missing")),
        ("1", "", "", ("missing",)),
    ],
)
def test_plain_reasons(parse, valid, reason, value, reasons):
    (stride,) = parse(f"time_s,value,valid,reason\n0,{value},{valid},{reason}\n").strides

    assert find_invalid_reasons(stride.measurement, A2) == reasons


def test_further_columns_of_plain_are_extra_values(parse):
    (stride,) = parse("time_s,value,slope_deg,pulse,hit\n0,3,-1.5,NaN,1\n").strides

    assert stride.measurement.extra == {"slope_deg": -1.5}


def test_two_legs_need_a_choice(parse):
    text = "time_s,value,side\n0,3,L\n.5,2,R\n1,3,l\n1.5,2,right\n2,3,Left\n"

    with pytest.raises(RecordingError, match="strides of both legs. Say which one is trained"):
        parse(text)
    recording = parse(text, trained_side=Side.RIGHT)
    assert recording.trained_side is Side.RIGHT
    assert recording.phases[0].strides == 2
    assert [m.side for m in recording] == ["left", "right", "left", "right", "left"]


def test_a_leg_that_the_file_does_not_name_is_the_caller_s(parse):
    recording = parse("time_s,value\n0,3\n", trained_side=Side.RIGHT)

    assert recording.trained_side is Side.RIGHT
    assert [m.side for m in recording] == [Side.RIGHT]


def test_the_other_leg_cannot_be_trained(parse, hebb03):
    with pytest.raises(RecordingError, match="holds no stride of the right leg"):
        parse(hebb03({}), trained_side=Side.RIGHT)


def test_a_phase_of_the_other_leg_would_never_end(parse):
    text = "time_s,value,side,kind\n0,3,L,baseline\n1,3,R,catch\n"

    with pytest.raises(RecordingError, match=r"Row 3 .*'Catch' .* no stride of the trained leg"):
        parse(text, trained_side=Side.LEFT)


def test_layout_can_be_said(parse):
    both = "time_s,value," + HEBB91 + "0,3,1,2.1,0,10,0.5\n"

    with pytest.raises(RecordingError, match="fits the layouts hebb91, plain. Say which is meant"):
        parse(both)
    assert parse(both, layout="plain").strides[0].measurement.value == 3
    assert parse(both, layout="hebb91").strides[0].measurement.value == 2.1
    with pytest.raises(RecordingError, match="no layout 'x'. Known layouts: hebb03, hebb91, plain"):
        parse(both, layout="x")


def test_the_documented_example_reads(parse):
    page = (Path(__file__).parents[3] / "docs" / "recordings.md").read_text("utf-8")
    example = re.search(r"```csv\n(.*?)```", page, re.DOTALL)
    assert example is not None
    recording = parse(example[1])

    assert [phase.strides for phase in recording.phases] == [2, 3, 1]
    assert recording.goal == 3.9


@pytest.mark.parametrize("layout", LAYOUTS.values(), ids=LAYOUTS)
def test_the_documentation_names_every_layout_and_column(layout):
    page = (Path(__file__).parents[3] / "docs" / "recordings.md").read_text("utf-8")

    assert f"## {layout.name}\n" in page
    for column in {*layout.required, *layout.other, *(layout.extra or ())}:
        assert f"`{column}`" in page


def test_a_recording_is_read_from_its_path(tmp_path):
    path = tmp_path / "walk.csv"
    path.write_text("time_s,value\n0,3\n", "utf-8")

    assert read_recording(path) == read_recording(str(path))
    assert read_recording(path).name == "walk.csv"
