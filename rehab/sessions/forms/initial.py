"""What the set-up begins with: the patient's last session, or defaults."""

from __future__ import annotations

from typing import Any

from django.db.models import QuerySet
from django.utils import timezone

from rehab.people.models import Patient, User
from rehab.sessions.formatting import format_source
from rehab.sessions.log import SessionEvent
from rehab.sessions.models import TrainingSession
from rehab.sessions.setup.cue_gestures import choices_from_cue
from rehab.sessions.setup.options import OPTIONS
from rehab.sessions.setup.protocol_models import MeasureDefinition, Protocol
from rehab.sessions.setup.protocol_outline import protocol_minutes
from rehab.sessions.setup.sensors import measurable
from rehab.sessions.setup.sources import LIVE, source_choices
from rehab.stations.models import Station
from rehab.training.changes import OPEN_STATES
from rehab.training.measures import A2, MEASURES
from rehab.training.steps import Side

TRAINING_ONLY, WITH_BASELINE = "Training only", "Baseline, training, washout"


def _first_free_station(stations: QuerySet[Station]) -> Station | None:
    """Return the first station without an open session, or else the first."""
    taken = stations.filter(sessions__state__in=[state.value for state in OPEN_STATES])
    return stations.exclude(pk__in=taken.values("pk")).first() or stations.first()


def last_session(patient: Patient, by: User) -> TrainingSession | None:
    """Return a patient's last session that was set up here: no import and no trial."""
    sessions = TrainingSession.objects.visible_to(by)
    sessions = sessions.filter(patient=patient, protocol__isnull=False)
    return sessions.order_by("-created_at", "-pk").first()


def initial_choices(patient: Patient, by: User) -> dict[str, Any]:
    """Return the set-up's initial values: those of the last session, or defaults."""
    stations = Station.objects.visible_to(by)
    protocols = Protocol.objects.visible_to(by)
    sources = dict(source_choices())
    last = last_session(patient, by)
    offered = {option.name: option.default for option in OPTIONS.values()}
    if last is None:
        name = TRAINING_ONLY if patient.simulated else WITH_BASELINE
        protocol = protocols.filter(name=name, clinic=None).first() or protocols.first()
        source = "synthetic demo" if patient.simulated else LIVE
        station = _first_free_station(stations)
        measure = _fitting_measure(usual_measure(by), station, source, by)
        return offered | {
            "measure": measure,
            "goal_value": measure.to_rule().offered_goal,
            "goal_by": "value" if patient.simulated else "percent",
            "minutes": protocol_minutes(protocol) or offered["minutes"],
            "protocol": protocol,
            "station": station,
            "source": source,
            "source_words": format_source(sources[source]),
            "trained_side": patient.paretic_side or Side.LEFT.value,
        }
    plan = last.to_plan()
    source = next((name for name, label in sources.items() if label == last.source), LIVE)
    if last.source_args and not patient.simulated:
        source = LIVE  # after a trial with a simulator, a person's next session is live again
    above, below = choices_from_cue(plan.valence.cue, last.valence, patient, by)
    station = last.station or _first_free_station(stations)
    measure = _fitting_measure(last.measure, station, source, by)
    rule = measure.to_rule()
    goal = rule.offered_goal if last.goal is None or measure != last.measure else last.goal
    changes = _read_last_changes(last, by)
    chosen = {o.name: o.read(plan, last.walking, changes) for o in OPTIONS.values()}
    protocol = last.protocol
    if measure != last.measure:  # a goal of another measure says nothing: a baseline does
        protocol = protocols.filter(name=WITH_BASELINE, clinic=None).first() or protocol
        chosen["goal_by"] = "percent"
    return chosen | {
        "measure": measure,
        "goal_value": round(goal, rule.goal_places),
        "goal_percent": chosen["goal_percent"] or offered["goal_percent"],
        "protocol": protocol,
        "station": station,
        "source": source,
        "source_words": format_source(sources[source]),
        "trained_side": last.trained_side,
        "robot_above": above,
        "robot_below": below,
    }


def _read_last_changes(session: TrainingSession, by: User) -> dict[str, Any]:
    """Return the last value of each kind of change in a session's log."""
    changes = SessionEvent.objects.visible_to(by).filter(
        session=session,
        kind__in=[option.control.value for option in OPTIONS.values() if option.control],
    )
    return {row.kind: row.data.get("value", row.value) for row in changes.order_by("pk")}


def _fitting_measure(
    wanted: MeasureDefinition, station: Station | None, source: str, by: User
) -> MeasureDefinition:
    """Return a measure, or one that a station's sensors have where it is not among these."""
    slugs = measurable(station, timezone.now()) if source == LIVE else None
    if slugs is None or wanted.slug in slugs:
        return wanted
    known = {row.slug: row for row in MeasureDefinition.objects.visible_to(by).filter(clinic=None)}
    return next((known[slug] for slug in MEASURES if slug in slugs and slug in known), wanted)


def usual_measure(by: User) -> MeasureDefinition:
    """Return A2, which all clinics share."""
    return MeasureDefinition.objects.visible_to(by).get(clinic=None, slug=A2.slug)
