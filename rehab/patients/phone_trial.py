"""A trial of a phone as a sensor: a session of the demo patient, into which a recording walks."""

from __future__ import annotations

from datetime import datetime

from django.utils.translation import gettext as _

from rehab.patients.first_steps import Found
from rehab.people.models import Patient, User
from rehab.sessions.live import runtime
from rehab.sessions.models import TrainingSession
from rehab.sessions.services import SessionRequest, change_session, create_session
from rehab.sessions.setup.protocol_models import MeasureDefinition
from rehab.stations.models import Station
from rehab.training.changes import OPEN_STATES, ChangeKind, State
from rehab.training.goals import TRIAL_BASELINE_STRIDES, GoalRule, Target
from rehab.training.measures import MEASURES
from rehab.training.phases import make_phase
from rehab.training.plans import ROBOT_LEVELS
from rehab.training.steps import Side
from rehab.training.valences import POSITIVE

MEASURE, MINUTES = MEASURES["shank_stance"], 10
# Of the baseline's mean: the shins of `stroke_imu` reach it with 76 % of their later strides, each
# with at least a fifth; the mean itself with 46 %, four of 36 legs hardly ever.
GOAL_PERCENT = 98.0
BASELINE_STRIDES = 10  # of which `TRIAL_BASELINE_STRIDES` have to be valid


def find_trial(user: User) -> TrainingSession | None:
    """Return the open trial of a user's clinic."""
    return (
        TrainingSession.objects.visible_to(user)
        .filter(
            patient__simulated=True,
            measure__slug=MEASURE.slug,
            protocol=None,
            state__in=[state.value for state in OPEN_STATES],
        )
        .select_related("patient", "station", "measure")
        .first()
    )


def begin_trial(patient: Patient, station: Station, side: Side | None, by: User) -> TrainingSession:
    """Return the open trial of a leg, a new one where there is none.

    Without a leg it is the open trial's, else the patient's, who keeps the leg of the latest one.
    One of the other leg that has not started ends. Raises StationTaken where any other session is
    open at the station.
    """
    trial = find_trial(by)
    if trial is not None and side in (None, trial.trained_side):
        return trial
    side = side or Side(patient.paretic_side or Side.LEFT)
    if trial is not None and trial.state == State.READY:
        change_session(trial, ChangeKind.ABORT, by=by)
    trial = create_session(
        SessionRequest(
            patient=patient,
            valence=POSITIVE.slug,
            measure=MeasureDefinition.objects.visible_to(by).get(clinic=None, slug=MEASURE.slug),
            goal=GoalRule(
                percent_of_baseline=GOAL_PERCENT, baseline_strides=TRIAL_BASELINE_STRIDES
            ),
            phases=[
                make_phase(kind="baseline", strides=BASELINE_STRIDES, robot=False),
                make_phase(kind="training", robot=False),
            ],
            robot_intensity=ROBOT_LEVELS["off"],
            target=Target(duration_s=60 * MINUTES),
            trained_side=side,
            station=station,
            created_by=by,
        )
    )
    if patient.paretic_side != side:
        patient.paretic_side = side
        patient.save(update_fields=["paretic_side"])
    return trial


def look_at_trial(trial: TrainingSession, now: datetime) -> dict[str, Found]:
    """Return what of it is there: the patient's screen, the phone's, what the phone will play."""
    running = runtime.peek()
    live = running.sessions.get(trial.pk) if running else None
    presence = live.presence(now) if live else {"tablets": 0, "source": False, "source_plays": ""}
    name = {"name": trial.patient.nickname}
    return {
        slug: Found(is_there, words if is_there else missing)
        for slug, is_there, words, missing in (
            (
                "screen",
                bool(presence["tablets"]),
                _("A screen shows %(name)s") % name,
                _("No screen shows %(name)s") % name,
            ),
            ("phone", bool(presence["source"]), _("connected"), _("not connected")),
            ("recording", bool(presence["source_plays"]), _("chosen"), _("none yet")),
        )
    }
