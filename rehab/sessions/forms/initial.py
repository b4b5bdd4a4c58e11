"""What the set-up begins with: the patient's last session, or defaults."""

from __future__ import annotations

from typing import Any

from django.db.models import QuerySet

from rehab.people.models import Patient, User
from rehab.sessions.formatting import format_source
from rehab.sessions.log import SessionEvent
from rehab.sessions.models import TrainingSession
from rehab.sessions.setup.answers import USUAL_ANSWERS, answers_of
from rehab.sessions.setup.gestures import DEFAULT_GESTURE, choices_from_cue
from rehab.sessions.setup.outline import protocol_minutes
from rehab.sessions.setup.protocols import MeasureDefinition, Protocol
from rehab.sessions.setup.sources import LIVE, source_choices
from rehab.stations.models import Station
from rehab.training.changes import OPEN_STATES, ChangeKind
from rehab.training.measures import A2
from rehab.training.plans import name_robot_level
from rehab.training.steps import Side

# The paper's example of a goal for a whole session (docs/reference/original.md#goal-of-a-session):
# 60 % of the steps, ten minutes.
WANTED_HITS_PERCENT = 60
PLANNED_MINUTES = 10
TRAINING_ONLY, WITH_BASELINE = "Training only", "Baseline, training, washout"


def _first_free_station(stations: QuerySet[Station]) -> Station | None:
    """Return the first station without an open session, or else the first."""
    taken = stations.filter(sessions__state__in=[state.value for state in OPEN_STATES])
    return stations.exclude(pk__in=taken.values("pk")).first() or stations.first()


def initial_choices(patient: Patient, by: User) -> dict[str, Any]:
    """Return the set-up's initial values: those of the last session, or defaults."""
    stations = Station.objects.visible_to(by)
    sources = dict(source_choices())
    last = (
        TrainingSession.objects.visible_to(by)
        .filter(patient=patient, protocol__isnull=False)
        .order_by("-created_at", "-pk")
        .first()
    )
    if last is None:
        name = TRAINING_ONLY if patient.simulated else WITH_BASELINE
        protocols = Protocol.objects.visible_to(by)
        protocol = protocols.filter(name=name, clinic=None).first() or protocols.first()
        return {
            "valence": "positive",
            "measure": usual_measure(by),
            "goal_by": "value" if patient.simulated else "percent",
            "goal_value": A2.offered_goal,
            "goal_percent": 100,
            "wanted_hits": WANTED_HITS_PERCENT,
            "minutes": protocol_minutes(protocol) or PLANNED_MINUTES,
            "protocol": protocol,
            "station": _first_free_station(stations),
            "source": (source := "synthetic demo" if patient.simulated else LIVE),
            "source_words": format_source(sources[source]),
            "trained_side": patient.paretic_side or Side.LEFT.value,
            "robot": "normal",
            "robot_above": DEFAULT_GESTURE,
            "robot_below": DEFAULT_GESTURE,
            "device": "",
            "belt_speed": None,
            "weight_support": None,
            **USUAL_ANSWERS,
        }
    plan = last.to_plan()
    source = next((name for name, label in sources.items() if label == last.source), LIVE)
    if last.source_args and not patient.simulated:
        source = LIVE  # after a trial with a simulator, a person's next session is live again
    hits, seconds = plan.target.hit_rate, plan.target.duration_s
    above, below = choices_from_cue(plan.valence.cue, last.valence, patient, by)
    at_end = _read_last_changes(last, by).get
    return {
        "valence": last.valence,
        "measure": last.measure,
        "goal_by": "percent" if plan.goal.needs_baseline else "value",
        "goal_value": round(
            plan.measure.offered_goal if last.goal is None else last.goal, plan.measure.goal_places
        ),
        "goal_percent": plan.goal.percent_of_baseline or 100,
        "wanted_hits": round(100 * hits) if hits else None,
        "minutes": round(seconds / 60) if seconds else None,
        "protocol": last.protocol,
        "station": last.station or _first_free_station(stations),
        "source": source,
        "source_words": format_source(sources[source]),
        "trained_side": last.trained_side,
        "robot": name_robot_level(at_end(ChangeKind.ROBOT_INTENSITY, plan.robot_intensity)),
        "robot_above": above,
        "robot_below": below,
        "device": last.device,
        "belt_speed": last.belt_speed_m_s,
        "weight_support": last.weight_support_percent,
        **answers_of(
            plan,
            threshold=at_end(ChangeKind.ACTIVATION_THRESHOLD, plan.activation_threshold),
            mode=at_end(ChangeKind.GOAL_ADAPTATION, plan.adaptation.mode.value),
        ),
    }


def _read_last_changes(session: TrainingSession, by: User) -> dict[str, Any]:
    """Return the last value of each kind of change in a session's log."""
    changes = SessionEvent.objects.visible_to(by).filter(
        session=session,
        kind__in=[
            ChangeKind.ROBOT_INTENSITY.value,
            ChangeKind.ACTIVATION_THRESHOLD.value,
            ChangeKind.GOAL_ADAPTATION.value,
        ],
    )
    return {row.kind: row.data.get("value", row.value) for row in changes.order_by("pk")}


def usual_measure(by: User) -> MeasureDefinition:
    """Return A2, which all clinics share."""
    return MeasureDefinition.objects.visible_to(by).get(clinic=None, slug=A2.slug)
