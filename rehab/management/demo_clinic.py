"""A clinic of simulated patients who have trained for weeks."""

from __future__ import annotations

from datetime import datetime, timedelta

from rehab.people.models import Clinic, Patient, User
from rehab.people.models.choices import DEMO_NAMES
from rehab.people.roles import Role
from rehab.sessions.live.headless import simulate_strides
from rehab.sessions.live.session.aggregate import Row, SessionAggregate
from rehab.sessions.live.session.commits import Job, commit
from rehab.sessions.models import TrainingSession
from rehab.sessions.ownership import ClinicOwner
from rehab.sessions.services import SessionRequest, create_session
from rehab.sources.synthetic import PROFILES, SyntheticWalker
from rehab.training.changes import Change, ChangeKind
from rehab.training.goals import GoalRule
from rehab.training.phases import make_phase
from rehab.training.steps import Side
from rehab.training.valences import VALENCES

WEEKS, DAYS = 5, (0, 2, 4)  # three visits a week
STRIDES = 120
ACCOUNTS = {"lead": Role.LEAD, "pt": Role.PT, "researcher": Role.RESEARCHER}


def fill_clinic(password: str, now: datetime) -> Clinic:
    """Return a new clinic with accounts, patients and their sessions until yesterday."""
    clinic = Clinic.everywhere.create(name="Demo clinic")
    for name, role in ACCOUNTS.items():
        User.everywhere.create_user(name, password=password, role=role, clinic=clinic)
    profiles = list(PROFILES)
    for number, name in enumerate(DEMO_NAMES):
        patient = Patient.everywhere.create(
            clinic=clinic,
            code=f"demo-{number + 1}",
            nickname=name,
            paretic_side=("left", "right")[number % 2],
            body_mass_kg=70,
            simulated=True,
        )
        valence = list(VALENCES)[number % len(VALENCES)]
        for week in range(WEEKS):
            for day in DAYS:
                began = now - timedelta(days=7 * (WEEKS - week) - day, minutes=45 * number)
                seed = 100 * number + 10 * week + day
                _walk(patient, valence, profiles[number % len(profiles)], seed, began)
    return clinic


def _walk(patient: Patient, valence: str, profile: str, seed: int, began: datetime) -> None:
    """Store a session as if it had been walked then, scored by the same rules as any other."""
    side = Side(patient.paretic_side)
    session = create_session(
        SessionRequest(
            patient=patient,
            valence=valence,
            goal=GoalRule(percent_of_baseline=105),
            phases=(
                make_phase("baseline", strides=30),
                make_phase("training", strides=STRIDES - 50),
                make_phase("washout"),
            ),
            source=f"simulated {profile}",
        )
    )
    TrainingSession.everywhere.filter(pk=session.pk).update(created_at=began)
    session.created_at = began
    aggregate = SessionAggregate(session)
    rows: list[Row] = list(aggregate.change(Change(ChangeKind.START), None, began))
    walker = SyntheticWalker(PROFILES[profile], seed, side, valence)
    at = began
    for stride in simulate_strides(walker, aggregate.fold, STRIDES):
        at = began + timedelta(seconds=stride.time_s)
        rows.append(aggregate.record_step(stride, at))
    rows += aggregate.change(Change(ChangeKind.FINISH), None, at)
    epoch = ClinicOwner.everywhere.get_or_create(pk=session.clinic_id)[0].epoch
    commit([Job(aggregate, session.pk, epoch, rows, aggregate.summary(), lambda _: None)])
