"""Sixty people in four arms by the real path: in minutes, as the fold, and the same again."""

from __future__ import annotations

import io
import time

import pytest
from django.core.management import call_command

from rehab.studies.results.drawing import FIGURES, TABLES
from rehab.studies.simulation.example import example_trial
from rehab.studies.simulation.trial import simulate
from tests.support.simulated_studies import figures_of, walk_study

pytestmark = pytest.mark.django_db(transaction=True)  # the writer has a connection of its own
MINUTES = 5


def test_three_seeds_by_the_real_path_agree_with_the_fold_to_the_last_digit():
    trial = example_trial()
    for seed in (1, 2, 3):
        began = time.perf_counter()
        results = walk_study(trial, seed)
        took_s = time.perf_counter() - began
        print(f"seed {seed}: {len(results.participants)} people in {took_s:.0f} s")
        assert took_s < 60 * MINUTES
        assert figures_of(results.participants) == figures_of(simulate(trial, seed))


def test_planned_walked_analyzed_and_exported_twice_gives_the_same_files(tmp_path):
    for clinic in ("one", "other"):
        began = time.perf_counter()
        told = io.StringIO()
        call_command(
            "simulatestudy", seed=1, clinic=clinic, to=tmp_path / clinic, stdout=told, stderr=told
        )
        print(told.getvalue().rpartition("\r")[2])
        assert time.perf_counter() - began < 60 * MINUTES
    first = sorted((tmp_path / "one").glob("*.[cs]*v*"))
    assert len(first) == len(TABLES) + len(FIGURES)
    for file in first:
        assert file.read_bytes() == (tmp_path / "other" / file.name).read_bytes(), file.name
