"""`runsession`: a recorded session scored as the lab scored it, or a clear word why not."""

from __future__ import annotations

import asyncio
import csv
import json
import os
import socket
from io import StringIO
from pathlib import Path
from typing import Any

import pytest
from django.core.management import CommandError, call_command

from rehab.sessions.live.database import clinic_owners
from rehab.sessions.live.headless import Pace, run_session
from rehab.sessions.log import Step
from rehab.sessions.models import TrainingSession
from rehab.sessions.services import SessionRequest, create_session
from rehab.sources.recording import read_recording
from rehab.training.goals import GoalRule
from tests.support.data import recording
from tests.support.world import build_world, set_owner

pytestmark = pytest.mark.django_db(transaction=True)  # the writer has its own connection


def run(*arguments: str | int | Path) -> dict[str, Any]:
    out = StringIO()
    call_command("runsession", *map(str, arguments), "--json", stdout=out)
    return dict(json.loads(out.getvalue()))


# Mean over usable strides, hit rate over all rows with a value (docs/reference/gait.md#phases).
TABLE = {
    "SSWS": (54, 1.00, 3.908, 0.44),
    "SSWS_Fam": (30, 1.00, 4.392, 0.97),
    "SSWS_100A2": (51, 1.00, 3.769, 0.33),
    "SSWS_95A2": (48, 0.95, 3.604, 0.21),
    "SSWS_90A2": (101, 0.90, 4.263, 0.43),
    "SSWS_85A2": (679, 0.85, 5.608, 0.93),
    "SSWS_Catch": (115, 1.00, 4.150, 0.81),
    "SSWS_WO": (552, 1.00, 4.328, 0.92),
}


def test_hebb03_session_1_is_scored_stride_for_stride():
    file = recording("HEBB_03_Session_1.csv")
    result = run("--recording", file, "--valence", "positive", "--gain-from-recording")
    counts = {name: result[name] for name in ("strides", "valid", "invalid", "missing")}
    assert counts == {"strides": 1630, "valid": 1592, "invalid": 36, "missing": 2}
    flags = result["recorded_success"]
    assert (flags["compared"], flags["agree"]) == (1628, 1628)
    found = {
        phase["name"]: (
            phase["strides"],
            phase["gain"],
            round(phase["mean"], 3),
            round(phase["recorded_success"]["hit_rate"], 2),
        )
        for phase in result["phases"]
    }
    assert found == TABLE
    for phase in result["phases"]:  # our own rate leaves the unusable strides out
        assert phase["hit_rate"] == pytest.approx(phase["recorded_success"]["hit_rate"], abs=0.015)
    assert result["score"] == result["hits"] == Step.everywhere.filter(points=1).count()
    assert result["goal"] == pytest.approx(result["phases"][0]["mean"], rel=1e-9)


def test_hebb03_session_2_is_scored_whole():
    file = recording("HEBB_03_Session_2.csv")
    result = run("--recording", file, "--valence", "negative", "--gain-from-recording")
    counts = [result[name] for name in ("strides", "valid", "invalid", "missing")]
    assert counts == [1573, 1563, 10, 0]
    assert result["recorded_success"]["agree"] == 1573
    assert result["score"] == -Step.everywhere.filter(points=-1).count()


def test_hebb91_needs_its_goal_and_then_agrees():
    file = recording("HEBB_91_Session_1.csv")
    with pytest.raises(CommandError, match="--goal"):
        run("--recording", file, "--valence", "positive")
    result = run("--recording", file, "--valence", "explicit", "--goal", "2.5498")
    assert result["recorded_success"] == {
        "compared": 1375,
        "agree": 1375,
        "hits": pytest.approx(758, abs=2),
        "hit_rate": pytest.approx(0.55, abs=0.01),
    }
    assert result["score"] is None


@pytest.mark.wide
def test_one_changed_flag_lowers_the_agreement_by_one(tmp_path):
    rows = list(csv.reader(recording("HEBB_03_Session_1.csv").read_text().splitlines()))
    flag = rows[0].index("iA2_Success")
    rows[700][flag] = "0" if rows[700][flag] == "1" else "1"
    changed = tmp_path / "changed.csv"
    with changed.open("w", newline="") as out:
        csv.writer(out).writerows(rows)
    result = run("--recording", changed, "--valence", "binary", "--gain-from-recording")
    assert result["recorded_success"]["compared"] == 1628
    assert result["recorded_success"]["agree"] == 1627


def test_without_the_recorded_gain_the_rule_differs_from_the_file():
    file = recording("HEBB_03_Session_1.csv")
    result = run("--recording", file, "--valence", "positive")
    assert result["recorded_success"]["agree"] < 1628
    assert {phase["gain"] for phase in result["phases"]} == {1.0}


def test_a_simulated_patient_sets_a_goal_from_the_baseline():
    result = run("--synthetic", 7, "--valence", "binary", "--strides", "400")
    assert result["strides"] == 400
    assert [phase["kind"] for phase in result["phases"]] == ["baseline", "training", "washout"]
    assert result["goal"] == pytest.approx(result["phases"][0]["mean"])
    assert (
        run("--synthetic", 7, "--valence", "binary", "--strides", "400")["score"]
        == (result["score"])
    )
    session = TrainingSession.everywhere.first()
    assert session.simulated
    assert session.patient.simulated


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["--synthetic", "1", "--valence", "kind"], "invalid choice: 'kind'"),
        (["--synthetic", "1", "--valence", "binary", "--goal", "nan"], "not a finite number"),
        (["--synthetic", "1", "--valence", "binary", "--goal", "0"], "above 0 and up to 15 W/kg"),
        (["--synthetic", "1", "--valence", "binary", "--goal", "-3"], "above 0 and up to 15 W/kg"),
        (["--synthetic", "1", "--valence", "binary", "--speed", "0"], "above 0"),
        (["--synthetic", "1", "--valence", "binary", "--strides", "5"], "--strides 100 or more"),
        (["--synthetic", "1", "--valence", "binary", "--clinic", "Nowhere"], "no clinic 'Nowhere'"),
        (["--synthetic", "1", "--valence", "binary", "--patient", "99"], "no patient"),
        (["--recording", "none.csv", "--valence", "binary"], "no recording none.csv"),
        (["--valence", "binary"], "one of the arguments --recording --synthetic is required"),
    ],
)
def test_bad_arguments_say_the_cure_and_store_nothing(arguments, message):
    with pytest.raises((CommandError, SystemExit), match=message.replace("-", r"\-")):
        run(*arguments)
    assert not TrainingSession.everywhere.exists()


def test_a_broken_recording_names_row_and_column_and_stores_nothing(tmp_path):
    file = tmp_path / "walk.csv"
    file.write_text("time_s,value\n0.0,3.1\n1.1,three\n")
    with pytest.raises(CommandError, match=r"[Rr]ow 3.*value.*three"):
        run("--recording", file, "--valence", "binary", "--goal", "3")
    assert not TrainingSession.everywhere.exists()


def test_true_cadence_waits_for_each_stride_on_the_given_clock(tmp_path):
    file = tmp_path / "walk.csv"
    file.write_text("time_s,value\n10.0,3.1\n11.0,3.2\n12.5,2.9\n")
    walk = read_recording(file)
    now = [100.0]
    arrivals: list[float] = []

    async def sleep(seconds: float) -> None:
        now[0] += seconds
        arrivals.append(now[0])

    world = build_world("amber")
    session = create_session(
        SessionRequest(
            patient=world.patient,
            valence="positive",
            goal=GoalRule(value=3.0),
            phases=walk.phases,
        )
    )
    pace = Pace(2.0, lambda: now[0], sleep)
    asyncio.run(run_session(session.pk, lambda _: iter(walk), pace))
    assert arrivals == [100.0, 100.5, 101.25]


def test_a_run_that_breaks_leaves_an_aborted_session_with_its_steps(tmp_path):
    world = build_world("amber")
    session = create_session(
        SessionRequest(
            patient=world.patient,
            valence="positive",
            goal=GoalRule(value=3.0),
            phases=world.session.to_plan().phases,
        )
    )

    def strides(_):
        file = tmp_path / "walk.csv"
        file.write_text("time_s,value\n1.0,3.1\n2.0,3.2\n")
        yield from read_recording(file)
        raise ConnectionError("the source went away")

    with pytest.raises(ConnectionError):
        asyncio.run(run_session(session.pk, strides, Pace()))
    session.refresh_from_db()
    assert session.state == "aborted"
    assert Step.everywhere.filter(session=session).count() == 2


def test_a_clinic_that_another_process_runs_is_refused_before_anything_is_stored():
    world, parent = build_world("amber"), os.getppid()
    owner = f"{socket.gethostname()}|{parent}|{clinic_owners._start_time(parent)}"
    set_owner(world.clinic.pk, owner)
    before = TrainingSession.everywhere.count()
    with pytest.raises(CommandError, match=rf"another process \({parent}\).* --clinic"):
        run("--synthetic", 1, "--valence", "binary", "--clinic", world.clinic.name)
    assert TrainingSession.everywhere.count() == before
