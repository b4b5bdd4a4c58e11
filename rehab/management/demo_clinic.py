"""A clinic of simulated patients who have trained for weeks, and whose program goes on."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from datetime import datetime, timedelta
from typing import Any

from rehab.boards.choices import Aggregation, CountedTypes, DisplayMode, Occasion, Participants
from rehab.boards.models import Leaderboard
from rehab.patients.visits import plan_visit
from rehab.people.models import BoardsConsent, Clinic, Patient, User
from rehab.people.models.choices import DEMO_NAMES
from rehab.people.roles import DEMO_ACCOUNTS
from rehab.sessions.corrections import add_note
from rehab.sessions.formatting import clinic_time
from rehab.sessions.live.headless import simulate_strides
from rehab.sessions.live.session.aggregate import Row, SessionAggregate
from rehab.sessions.live.session.commit_transaction import Job, commit
from rehab.sessions.log import Remark
from rehab.sessions.models import TrainingSession
from rehab.sessions.ownership import ClinicOwner
from rehab.sessions.services import SessionRequest, create_session
from rehab.sources.synthetic import PROFILES, SyntheticWalker
from rehab.stations.builtin import first_station
from rehab.training.changes import Change, ChangeKind
from rehab.training.goals import GoalRule
from rehab.training.phases import make_phase
from rehab.training.steps import Side
from rehab.training.valences import VALENCES

VISITS, STRIDES = 15, 170  # of each patient; of a visit
BASELINE, TRAINED = 30, 110  # strides of these
EACH_WEEK = 3  # visits, all at the same hour
GOAL = 0.9  # of the usual walk: about half of the strides reach it


@dataclass(frozen=True, slots=True)
class Course:
    """How a patient's weeks went: profile, rise of the goal from visit to visit, days since the
    last visit, days until the planned one. ``noted``: visits, counted back, with what was said.
    """

    profile: str
    rise: float
    last: int
    planned: int | None
    noted: Mapping[int, str]


# One who improves, one who is stuck, one who has not come for long, one who gets worse, …
COURSES = (
    Course("demo", 0.027, 0, 2, {0: "New shoes today.", 6: "Tired after a short night."}),
    Course("poor", 0.0, 0, 3, {1: "Goal unchanged: works on her endurance first."}),
    Course("demo", 0.012, 11, None, {0: "Away with a cold next week."}),
    Course("fatiguing", -0.03, 1, 0, {2: "Rests after each block help."}),
    Course("dropout", 0.015, 2, -1, {0: "The sensor’s strap was loose."}),
    Course("good", 0.03, 1, 0, {}),
    Course("demo", 0.012, 3, 1, {3: "Walks without the handrail now."}),
)
BOARDS: tuple[dict[str, Any], ...] = (
    {
        "name": "Steps at the goal",
        "display": DisplayMode.TOP_AND_ME,
        "aggregation": Aggregation.BEST,
        "occasion": Occasion.AFTER_SESSION,
    },
    {
        "name": "Minutes together",
        "metric": "active_minutes",
        "display": DisplayMode.TOTAL,
        "aggregation": Aggregation.SUM,
        "total_goal": 600,
        "occasion": Occasion.WAITING,
    },
)


def fill_clinic(password: str, now: datetime) -> Clinic:
    """Return a new clinic with accounts, patients, their sessions until now, visits and boards."""
    clinic = Clinic.everywhere.create(name="Demo clinic")
    people = {
        name: User.everywhere.create_user(name, password=password, role=role, clinic=clinic)
        for name, role in DEMO_ACCOUNTS.items()
    }
    patients = [
        Patient.everywhere.create(
            clinic=clinic,
            code=f"demo-{number + 1}",
            nickname=name,
            paretic_side=("left", "right")[number % 2],
            body_mass_kg=70,
            boards=BoardsConsent.CLINIC,
            simulated=True,
        )
        for number, name in enumerate(DEMO_NAMES[: len(COURSES) + 1])
    ]
    local = clinic_time(now, clinic)
    for number, (patient, course) in enumerate(zip(patients, COURSES, strict=False)):
        for back in reversed(range(VISITS)):
            days = course.last + back * 7 // EACH_WEEK
            began = now - timedelta(days=days, minutes=45 * (number + 1))
            _walk(patient, course, number, back, began, people["pt"])
        if course.planned is not None:
            day = local.date() + timedelta(days=course.planned)
            plan_visit(patient, day, local.replace(minute=30 * (number % 2)).time())
    plan_visit(patients[-1], local.date(), None)  # one who is new
    for board in BOARDS:
        Leaderboard.everywhere.create(
            clinic=clinic, among=Participants.CLINIC, types=CountedTypes.ALL, **board
        )
    return clinic


def _walk(
    patient: Patient, course: Course, number: int, back: int, began: datetime, by: User
) -> None:
    """Store a session as if it had been walked then, scored by the same rules as any other."""
    valence = list(VALENCES)[number % len(VALENCES)]
    side = Side(patient.paretic_side)
    better = (1 + course.rise) ** (VISITS - 1 - back)
    usual = PROFILES[course.profile]
    profile = replace(usual, baseline_w_kg=usual.baseline_w_kg * better)
    session = create_session(
        SessionRequest(
            patient=patient,
            valence=valence,
            goal=GoalRule(value=round(GOAL * profile.baseline_w_kg, 2)),
            phases=(
                make_phase("baseline", strides=BASELINE),
                make_phase("training", strides=TRAINED),
                make_phase("washout"),
            ),
            station=first_station(patient.clinic),
            created_by=by,
            source=f"simulated {course.profile}",
        )
    )
    TrainingSession.everywhere.filter(pk=session.pk).update(created_at=began)
    session.created_at = began
    aggregate = SessionAggregate(session)
    rows: list[Row] = list(aggregate.change(Change(ChangeKind.START), by, began))
    walker = SyntheticWalker(profile, 100 * number + back, side, valence)
    at = began
    for stride in simulate_strides(walker, aggregate.fold, STRIDES):
        at = began + timedelta(seconds=stride.time_s)
        rows.append(aggregate.record_step(stride, at))
    rows.append(aggregate.log_event(Remark.BORG, by, at, {}, 2 + (number + back) % 4))
    if (number + 2 * back) % 9 == 0:
        rows.append(aggregate.log_event(Remark.NEAR_FALL, by, at, {}))
    rows += aggregate.change(Change(ChangeKind.FINISH), by, at)
    epoch = ClinicOwner.everywhere.get_or_create(pk=session.clinic_id)[0].epoch
    commit([Job(aggregate, session.pk, epoch, rows, aggregate.summary(), lambda _: None)])
    if back in course.noted:
        add_note(session, course.noted[back], by, at)
