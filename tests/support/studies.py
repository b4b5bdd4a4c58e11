"""Studies to test with: two arms, registered and running."""

from __future__ import annotations

from datetime import date, timedelta
from typing import Any

from django.test import Client

from rehab.people.consent.models import Purpose
from rehab.people.consent.services import record_consent
from rehab.people.models import Patient, User
from rehab.people.roles import Role
from rehab.sessions.setup.protocol_models import MeasureDefinition, Protocol
from rehab.studies.agreements import StudyConsent
from rehab.studies.allocation.scheme import Secret
from rehab.studies.blinding import Task, give_mark
from rehab.studies.models import Arm, Study
from rehab.studies.participants import Enrollment
from rehab.studies.registration.allocation_secret import seal
from rehab.studies.registration.lifecycle import register, start
from rehab.training.measures import A2
from tests.support.world import NOW, World, signed_in

SEED = "the seed of tests"
CONSENT = StudyConsent("1.0", NOW.date() - timedelta(days=1))
STROKE = date(2020, 1, 1)  # years before `NOW`


def draft_study(world: World, *valences: str, **settings: Any) -> Study:
    """Return a draft with an arm of each feedback type, positive and negative unless given."""
    defaults: dict[str, Any] = {
        "code": "VAL",
        "title": "A comparison of two ways to answer a step",
        "question": "Which way keeps more of the push-off?",
        "participants": 20,
        "months_since_stroke": 6,
        "visits": 2,
        "primary_outcome": "washout_change",
        "sealed": seal(Secret(SEED, (2, 4))),
    }
    study = Study.everywhere.create(clinic=world.clinic, **defaults | settings)
    measure = MeasureDefinition.everywhere.get(clinic=None, slug=A2.slug)
    protocol = Protocol.everywhere.get(clinic=None, name="Baseline, training, washout")
    for position, valence in enumerate(valences or ("positive", "negative")):
        Arm.everywhere.create(
            study=study,
            position=position,
            code="ABCDEFGH"[position],
            name=f"feedback {valence}",
            valence=valence,
            measure=measure,
            protocol=protocol,
        )
    return study


def running_study(world: World, *valences: str, **settings: Any) -> Study:
    """Return a study that takes patients in."""
    study = draft_study(world, *valences, **settings)
    lead = world.people[Role.LEAD]
    register(study, lead, NOW)
    start(study, lead, NOW)
    return study


def new_patient(world: World, number: int = 1, *, consents: bool = True) -> Patient:
    """Return a patient of the world's clinic who is in no study yet."""
    patient = Patient.everywhere.create(
        clinic=world.clinic,
        code=f"n{number}",
        nickname=f"Newcomer {number}",
        paretic_side="left",
        stroke_month=STROKE,
    )
    if consents:
        record_consent(patient, Purpose.RESEARCH, None, NOW)
    return patient


def enrolled(study: Study, patient: Patient, **settings: Any) -> Enrollment:
    """Return a patient's enrollment in a running study."""
    from rehab.studies.enrolling import enroll

    options: dict[str, Any] = {"keep_data": True, "by": None, "now": NOW, "consent": CONSENT}
    options |= settings
    return enroll(study, patient, options.pop("levels", ()), **options)


def text_of(response: Any) -> str:
    """Return the words of an answer."""
    return str(response.content.decode())


def refusals(caplog) -> list[str]:
    """Return what the studies' pages logged of refusals."""
    return [
        one.getMessage() for one in caplog.records if one.name.endswith("studies.pages.refusals")
    ]


def hide_from(study: Study, world: World) -> Client:
    """Return a client of a new account that must not know the arms of ``study``."""
    assessor = User.everywhere.create_user("assessor", role=Role.PT, clinic=world.clinic)
    give_mark(study, assessor, Task.ASSESSOR, None, NOW)
    return signed_in(assessor)
