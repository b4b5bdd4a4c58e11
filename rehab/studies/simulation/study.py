"""A simulated study by the real path: planned, randomized, and walked through the live session."""

from __future__ import annotations

import asyncio
from collections.abc import Iterator, Mapping
from datetime import datetime
from functools import partial

from rehab.people.models import Clinic, Patient
from rehab.sessions.live.headless import Pace, run_session
from rehab.sessions.setup.default_protocols import install_defaults
from rehab.sessions.setup.protocol_models import MeasureDefinition, Protocol, ProtocolPhase
from rehab.studies.enrolling import enroll, withdraw
from rehab.studies.models import Arm, Study, StudyState
from rehab.studies.participants import Enrollment
from rehab.studies.registration.allocation_secret import seal
from rehab.studies.registration.lifecycle import close, register, start
from rehab.studies.registration.measurable import SEVERAL_VISITS
from rehab.studies.results.results import Results, read_results
from rehab.studies.simulation.example import ARMS, OUTCOME, PHASES, SECONDARY
from rehab.studies.simulation.trial import Trial
from rehab.studies.simulation.walkers import Person, walk_through
from rehab.studies.visits import Place, next_visit, start_session
from rehab.training.changes import State
from rehab.training.measures import A2, InvalidSetting
from rehab.training.steps import Side

SEED_MAX = 99_999
PLACE = Place(source="simulated")
PROTOCOL = "Simulated study"


def find_or_plan(
    clinic: Clinic, trial: Trial, seed: int, now: datetime, facts: Mapping[str, str] | None = None
) -> Study:
    """Return the simulated study of a seed, planned, registered and started where it is new.

    Parameters
    ----------
    clinic
        Where it is stored.
    trial
        What is simulated.
    seed
        0 to ``SEED_MAX``; part of the study's code, which is unique in a clinic.
    now
        The time of its registration and start.
    facts
        What it is registered with of `registration.facts`.

    Raises
    ------
    InvalidSetting
        For a seed out of bounds, and where the clinic has simulated another study from it.
    """
    if not 0 <= seed <= SEED_MAX:
        raise InvalidSetting("A seed is a whole number from 0 to {most}.", most=SEED_MAX)
    code = f"SIM{seed}"
    known = Study.everywhere.filter(clinic=clinic, code=code).first()
    if known is None:
        return _plan(clinic, code, trial, seed, now, facts or {})
    if (known.participants, known.visits) != (trial.participants, trial.visits):
        raise InvalidSetting(
            "Seed {seed} has {participants} participants and {visits} visits in this clinic. Give "
            "these again, or another seed.",
            seed=seed,
            participants=known.participants,
            visits=known.visits,
        )
    return known


def _plan(
    clinic: Clinic, code: str, trial: Trial, seed: int, now: datetime, facts: Mapping[str, str]
) -> Study:
    install_defaults()
    protocol = _find_protocol(clinic)
    study = Study.everywhere.create(
        clinic=clinic,
        code=code,
        title="Four ways to answer a step, simulated",
        question="Do intervals cover what each arm truly adds? Nobody walked here.",
        participants=trial.participants,
        months_since_stroke=6,
        inclusion="Hemiparesis after stroke; walks on a treadmill for ten minutes",
        visits=trial.visits,
        primary_outcome=OUTCOME,
        secondary_outcomes=[
            slug for slug in SECONDARY if trial.visits > 1 or slug not in SEVERAL_VISITS
        ],
        facts=dict(facts),
        sealed=seal(trial.secret(seed)),
    )
    measure = MeasureDefinition.everywhere.get(clinic=None, slug=A2.slug)
    for position, (arm, valence, effect) in enumerate(ARMS):
        Arm.everywhere.create(
            study=study,
            position=position,
            code=arm,
            name=f"{valence}, truly {effect:+g} %".replace("-", "\N{MINUS SIGN}"),
            valence=valence,
            measure=measure,
            protocol=protocol,
        )
    register(study, None, now)
    start(study, None, now)
    return study


def _find_protocol(clinic: Clinic) -> Protocol:
    protocol, is_new = Protocol.everywhere.get_or_create(clinic=clinic, name=PROTOCOL)
    if is_new:
        for position, phase in enumerate(PHASES, start=1):
            ProtocolPhase.everywhere.create(
                protocol=protocol,
                position=position,
                kind=phase.kind,
                name=phase.name,
                feedback=phase.feedback,
                strides=phase.strides,
            )
    return protocol


def walk_study(
    study: Study, trial: Trial, seed: int, now: datetime, pace: Pace | None = None
) -> Iterator[int]:
    """Enroll and walk the participants who are missing, and yield how many are done.

    Sessions of an interrupted run are not repeated: it is continued.

    Parameters
    ----------
    study, trial, seed
        The study that ``find_or_plan`` returned for this trial and seed.
    now
        The time of enrollments and withdrawals.
    pace
        As fast as strides are stored unless given.
    """
    for number, (person, _group) in enumerate(trial.allocate(seed), start=1):
        if study.state == StudyState.RUNNING:
            enrollment = _find_or_enroll(study, number, now)
            _walk_all(enrollment, trial, person, now, pace or Pace())
        yield number


def _find_or_enroll(study: Study, number: int, now: datetime) -> Enrollment:
    code = f"{study.code}-{number:03}"
    known = study.enrollments.filter(code=code).first()
    if known is not None:
        return known
    patient, _is_new = Patient.everywhere.get_or_create(
        clinic=study.clinic,
        code=code,
        defaults={"nickname": code, "paretic_side": Side.LEFT.value, "simulated": True},
    )
    return enroll(
        study, patient, (), keep_data=True, by=None, now=now, met=study.inclusion_criteria
    )


def _walk_all(
    enrollment: Enrollment, trial: Trial, person: Person, now: datetime, pace: Pace
) -> None:
    while enrollment.withdrawn_at is None and (visit := next_visit(enrollment)) is not None:
        if 0 < person.leaves_before <= visit.number:
            withdraw(enrollment, None, now)
            return
        arm = enrollment.allocation.arm_of_period(visit.period)
        if visit.session is not None and visit.session.state != State.ABORTED:
            return
        session = start_session(enrollment, PLACE, None, now)
        walker = person.at_visit(visit.number, trial.effects[arm.code], trial.population.retained)
        asyncio.run(run_session(session.pk, partial(walk_through, walker), pace))


def finish_study(study: Study, now: datetime) -> Results:
    """Close a study whose participants have walked at ``now``, and return its results."""
    if study.state == StudyState.RUNNING:
        close(study, None, now)
    return read_results(study, now)
