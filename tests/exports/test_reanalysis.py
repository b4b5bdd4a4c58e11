"""Whoever has the export alone gets the results again: by Python to 1e-9, by R where it is."""

from __future__ import annotations

import csv
import io
import json
import os
import shutil
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from rehab.exports.research.study_files import analysis_files
from rehab.studies.allocation.crossover import crossover_groups
from rehab.studies.analysis.comparison import compare
from rehab.studies.analysis.findings import observations
from rehab.studies.analysis.participants import Participant, ParticipantVisit
from rehab.studies.models import Study
from rehab.studies.registration.lifecycle import close
from rehab.studies.registration.outcome_changes import registered_outcomes
from rehab.studies.registration.protocol_json import write_json
from rehab.studies.results.drawing import TABLES, write_table
from rehab.studies.results.harms_and_deviations import ENDED_EARLY, Occurrence
from rehab.studies.results.reading import Analysis
from rehab.studies.results.results import Results, label_arms
from rehab.studies.screening import count_assessed
from tests.support.studies import running_study
from tests.support.world import NOW, World

pytestmark = pytest.mark.django_db
OUTCOMES = ("washout_change", "late_change", "variation")
PLAN = {"margin": 4.0, "spending": "pocock", "planned_sd": 3.0}


def people_of(design: str, clinic: int = 0) -> tuple[Participant, ...]:
    """Return 24 people, some of whom missed the second visit."""
    draw = np.random.default_rng([38, clinic, design == "crossover"])
    found = []
    for row in range(24):
        orders = ["-".join(g.arms) for g in crossover_groups(["A", "B"])]
        group = orders[row % 2] if design == "crossover" else "AB"[row % 2]
        arms = group.split("-") if "-" in group else [group, group]
        person, baseline = draw.normal(10 * clinic, 4), float(draw.normal(3, 0.5))
        visits = []
        for number, arm in enumerate(arms, 1):
            figures = person + draw.normal(0, 2, len(OUTCOMES)) + 3 * (arm == "B") + number
            here = number == 1 or draw.random() < 0.75
            outcomes = dict(zip(OUTCOMES, map(float, figures), strict=True)) if here else {}
            period = number - 1 if design == "crossover" else 0
            visits.append(ParticipantVisit(number, arm, period=period, outcomes=outcomes))
        levels = (("mild", "se, vere")[row % 3 == 0],)
        code = f"VAL-{row + 1:03}"
        found.append(
            Participant(code, tuple(visits), baseline=baseline, measure="a2", levels=levels)
        )
    return tuple(found)


def results_of(
    world: World, design: str, people: tuple[Participant, ...], primary: str = OUTCOMES[0]
) -> Results:
    """Return the results of a closed study in which these people walked."""
    secondary = [slug for slug in OUTCOMES if slug != primary]
    crossover = design == "crossover"
    outcomes = {"primary_outcome": primary, "secondary_outcomes": secondary}
    study = running_study(world, crossover=crossover, **outcomes, **PLAN)
    close(study, None, NOW)
    study = Study.everywhere.get(pk=study.pk)
    arms = label_arms(study)
    departed = tuple(Occurrence(ENDED_EARLY, f"VAL-{n:03}", "A", 1) for n in (3, 4, 9))
    return Results(
        study,
        Analysis(people, tuple(arms), crossover),
        arms,
        registered_outcomes(study),
        (),
        departed,
        count_assessed(study),
        looks=(8, 16),
    )


def write_folder(results: Results, folder: Path) -> Path:
    (folder / "garry_analysis").mkdir(parents=True)
    (folder / "protocol.json").write_text(write_json(results.study), "utf-8")
    definitions = [one.to_row() for one in results.study.outcomes.values()]
    (folder / "definitions.csv").write_text(write_table(definitions), "utf-8", newline="")
    for name, rows in TABLES.items():
        (folder / f"{name}.csv").write_text(write_table(rows(results)), "utf-8", newline="")
    for name, text in analysis_files():
        (folder / name).write_text(text, "utf-8")
    return folder


def run(*command: object) -> subprocess.CompletedProcess[str]:
    clean = {name: value for name, value in os.environ.items() if name != "PYTHONPATH"}
    return subprocess.run(
        [str(word) for word in command],
        capture_output=True,
        text=True,
        check=False,
        cwd="/",
        env=clean,
    )


@pytest.mark.parametrize(
    ("design", "primary"),
    [
        ("parallel", "washout_change"),
        ("crossover", "washout_change"),
        ("parallel", "variation"),  # of which less is better: so is the margin
    ],
)
def test_python_redoes_the_tables_from_the_export_alone(world, tmp_path, design, primary):
    results = results_of(world, design, people_of(design), primary)
    folder = write_folder(results, tmp_path / "study")
    assert "garry_analysis" in (folder / "reanalyze.py").read_text("utf-8")
    done = run(sys.executable, folder / "reanalyze.py", folder)
    assert (done.returncode, done.stderr) == (0, "All tables are as they were computed again.\n")
    table = folder / "differences.csv"
    rows = list(csv.DictReader(io.StringIO(table.read_text("utf-8"))))
    assert {row["outcome"] for row in rows} == set(OUTCOMES)
    assert all(row["per_protocol_low_95"] and row["p_holm"] for row in rows)
    assert rows[0]["not_inferior"] in {"true", "false"}
    assert float(rows[0]["level"]) < 0.05
    # It detects: one figure that is off by a billionth of itself and more is named.
    cell = rows[0]["per_protocol_low_95"]
    table.write_text(
        table.read_text("utf-8").replace(cell, repr(float(cell) + 1e-8)), "utf-8", newline=""
    )
    done = run(sys.executable, folder / "reanalyze.py", folder)
    assert done.returncode == 1
    assert "differences, row 1, per_protocol_low_95" in done.stderr


def test_several_clinics_are_analyzed_together_with_the_clinic_as_a_stratum(world, tmp_path):
    people = [people_of("parallel", clinic) for clinic in range(3)]
    first = results_of(world, "parallel", people[0])
    folders = [write_folder(first, tmp_path / "0")]
    for clinic in (1, 2):
        analysis = replace(first.analysis, participants=people[clinic])
        folders.append(write_folder(replace(first, analysis=analysis), tmp_path / str(clinic)))
    done = run(sys.executable, folders[0] / "reanalyze.py", *folders)
    assert (done.returncode, done.stderr) == (0, "")
    rows = json.loads(done.stdout)["differences"]
    gone = {(one.participant, one.visit) for one in first.occurrences}
    for row in rows[:3]:
        together = [
            replace(
                one, participant=f"{clinic}/{one.participant}", strata=(*one.strata, str(clinic))
            )
            for clinic in range(3)
            for one in observations(people[clinic], row["outcome"])
        ]
        [found] = compare(together, ["A", "B"], crossover=False).differences
        followed = [
            one for one in together if (one.participant.partition("/")[2], one.visit) not in gone
        ]
        [kept] = compare(followed, ["A", "B"], crossover=False).differences
        for name, value in (
            ("difference", found.difference.estimate),
            ("low_95", found.difference.low),
            ("p", found.p),
            ("per_protocol_high_95", kept.difference.high),
        ):
            assert row[name] == pytest.approx(value, rel=1e-9)
        assert row["participants"] == 36
    # Which clinic looked first nobody knows: no level is made up, nor that it is not inferior.
    assert (rows[0]["level"], rows[0]["not_inferior"]) == (None, None)


@pytest.mark.skipif(shutil.which("Rscript") is None, reason="R is not installed here")
@pytest.mark.parametrize("design", ["parallel", "crossover"])
def test_r_redoes_the_differences_with_a_model_of_its_own(world, tmp_path, design):
    folder = write_folder(results_of(world, design, people_of(design)), tmp_path / "study")
    done = run("Rscript", folder / "reanalyze.R", folder)
    assert done.returncode == 0, done.stdout + done.stderr
    assert done.stdout.count("VAL") == 0
    assert "Largest relative difference" in done.stdout
