"""Simulated studies by the real path, and what is compared of them."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

from rehab.people.models import Clinic
from rehab.studies.analysis.participants import Participant
from rehab.studies.results.results import Results
from rehab.studies.simulation import study as simulated
from rehab.studies.simulation.trial import Trial
from tests.support.world import NOW


def walk_study(trial: Trial, seed: int, clinic: str = "Simulated studies") -> Results:
    """Return the results of a study, walked from wherever it was broken off."""
    where, _is_new = Clinic.everywhere.get_or_create(name=clinic)
    study = simulated.find_or_plan(where, trial, seed, NOW)
    for _done in simulated.walk_study(study, trial, seed, NOW):
        pass
    return simulated.finish_study(study, NOW)


def figures_of(participants: Iterable[Participant]) -> list[Any]:
    """Return all that is analyzed of participants, without what they are called."""
    return [
        ([(v.number, v.arm, v.outcomes, v.phases) for v in one.visits], one.curves, one.has_left)
        for one in participants
    ]
