"""Creating sessions and changing them, for pages, API and commands."""

from __future__ import annotations

import secrets
from collections.abc import AsyncIterator, Iterable, Sequence
from contextlib import asynccontextmanager
from dataclasses import asdict, dataclass, field, fields, replace
from functools import partial

from asgiref.sync import async_to_sync
from django.db import transaction
from django.utils.translation import gettext

from rehab.feedback.clinic_valences import valences_of
from rehab.people.consent.services import is_care_allowed
from rehab.people.models import Patient, User
from rehab.people.models.hidden_patients import hidden_patients
from rehab.sessions.alarms import ACKNOWLEDGMENTS, Alarm, OpenAlarms
from rehab.sessions.live import runtime
from rehab.sessions.live.orders import ChangeOrder, Order, RemarkOrder
from rehab.sessions.log import ALARM_KINDS, SessionEvent
from rehab.sessions.models import TrainingSession
from rehab.sessions.questionnaires import ask
from rehab.sessions.setup.cue_gestures import composed_gestures, silence_cue
from rehab.sessions.setup.protocol_models import MeasureDefinition, Protocol
from rehab.sessions.setup.sources import is_simulated
from rehab.sessions.setup.walking_conditions import WalkingConditions
from rehab.stations.models import Station
from rehab.training.changes import OPEN_STATES, ChangeKind, ChangeValue, PauseReason
from rehab.training.closeness import CloseSteps
from rehab.training.measures import A2, InvalidSetting, Measure
from rehab.training.phases import Phase
from rehab.training.plans import PlanSettings, SessionPlan
from rehab.training.steps import Side
from rehab.training.valences import CueGestures, Valence, find_valence
from robot.wire.cue_limits import SEED_MAX


class StationTaken(InvalidSetting):
    """A session is open at this station, whose tablet and sensor serve one at a time.

    Attributes
    ----------
    session
        The open one.
    """

    def __init__(self, session: TrainingSession) -> None:
        message = gettext(
            "%(station)s still has an open session of %(patient)s. End it first, or choose "
            "another station."
        )
        super().__init__(message % {"station": session.station, "patient": session.patient})
        self.session = session


@dataclass(frozen=True, slots=True, kw_only=True)
class SessionRequest(PlanSettings):
    """What a new session is created from: the settings of its plan, and what the rest follows from.

    ``phases``: those of the protocol unless given. ``measure``: A2 unless given. ``rule``: how that
    is scored, as its row says unless given. ``trained_side``: the patient's paretic side unless
    given. ``cue``: that of the feedback type unless given. ``source_args``: arguments of
    `python -m rehab.sources` for a source that the server runs beside the session. ``simulated``:
    nobody walks, though neither patient nor arguments tell it.
    """

    patient: Patient
    valence: str
    phases: Iterable[Phase] | None = None
    protocol: Protocol | None = None
    measure: MeasureDefinition | None = None
    rule: Measure | None = None
    trained_side: Side | None = None
    cue: CueGestures | None = None
    station: Station | None = None
    created_by: User | None = None
    source: str = ""
    simulated: bool = False
    source_args: Sequence[str] = ()
    walking: WalkingConditions = field(default_factory=WalkingConditions)


def check_station_is_free(station: Station) -> None:
    """Raise StationTaken where a session is open at a station."""
    states = [state.value for state in OPEN_STATES]
    taken = TrainingSession.everywhere.filter(
        station=station, clinic=station.clinic_id, state__in=states
    )
    if (session := taken.select_related("patient", "station").first()) is not None:
        raise StationTaken(session)


def create_session(request: SessionRequest) -> TrainingSession:
    """Create a session that is ready to start, with everything that it will be scored with.

    Feedback is the clinic's own, in the patient's language. Nothing is stored where it raises
    InvalidSetting (a plan that could not be walked, a patient who has left or has not consented),
    StationTaken, or CrossClinic (patient, station and the rest are not of one clinic).
    """
    patient, station = request.patient, request.station
    measure = request.measure or MeasureDefinition.everywhere.get(clinic=None, slug=A2.slug)
    plan = _make_plan(request, measure)
    session = TrainingSession(
        clinic_id=patient.clinic_id,
        patient=patient,
        station=station,
        protocol=request.protocol,
        measure=measure,
        created_by=request.created_by,
        valence=plan.valence.slug,
        trained_side=plan.trained_side.value,
        source=request.source,
        simulated=request.simulated or is_simulated(patient, request.source_args),
        source_args=list(request.source_args),
        plan=plan.to_json(),
        goal=plan.goal.value,
        **asdict(request.walking),
    )
    with transaction.atomic():
        patient.lock()  # so that the patient is not erased meanwhile
        _check_patient_may_train(patient)
        _check_not_blinded(patient, request.created_by)
        if station is not None and station.clinic_id == patient.clinic_id:
            # Of two set-ups at once, the second waits here and then finds the first one's session.
            Station.everywhere.select_for_update(no_key=True).get(pk=station.pk)
            check_station_is_free(station)
        session.save()
        if request.protocol is not None:
            ask(session, request.protocol.questionnaires, session.created_at)
        transaction.on_commit(partial(_announce, session))
    return session


def _announce(session: TrainingSession) -> None:
    """Notify the tablet and devices of the station."""
    live = runtime.peek()
    if live is not None:
        live.loop.call_soon_threadsafe(live.announce, session.pk, session.station_id)


def _make_plan(request: SessionRequest, measure: MeasureDefinition) -> SessionPlan:
    """Return the plan of a session. Raises InvalidSetting for one that could not be walked."""
    patient, phases = request.patient, request.phases
    if phases is None:
        if request.protocol is None:
            raise InvalidSetting(gettext("A session needs a protocol, or phases of its own."))
        phases = request.protocol.to_rules()
    side = request.trained_side or (Side(patient.paretic_side) if patient.paretic_side else None)
    if side is None:
        raise InvalidSetting(
            gettext("Which leg is trained? Set the paretic side of %(patient)s, or choose a leg.")
            % {"patient": patient}
        )
    find_valence(request.valence)
    others = valences_of(patient.clinic_id, patient.language)
    default = others.pop(request.valence)
    valence = default if request.cue is None else replace(default, cue=request.cue)
    gestures = {gesture["name"]: gesture for gesture in composed_gestures(patient, valence.cue)}
    alternatives: list[Valence] = []
    for other in others.values() if not request.locked else ():
        cue = silence_cue(other.cue, default.cue, valence.cue)
        try:
            gestures |= {gesture["name"]: gesture for gesture in composed_gestures(patient, cue)}
        except InvalidSetting:  # a deleted gesture must not hinder a session of another type
            cue = CueGestures()
        alternatives.append(replace(other, cue=cue))
    return SessionPlan(
        measure=request.rule or measure.to_rule(),
        valence=valence,
        phases=tuple(phases),
        trained_side=side,
        **{one.name: getattr(request, one.name) for one in fields(PlanSettings)}
        | {"seed": request.seed or 1 + secrets.randbelow(SEED_MAX)},
        close_steps=request.protocol.close_steps(patient.language)
        if request.protocol
        else CloseSteps(),
        gestures=tuple(gestures.values()),
        alternatives=tuple(alternatives),
        language=patient.language,
    )


def _check_patient_may_train(patient: Patient) -> None:
    """Raise InvalidSetting for a patient who has left or has not consented to care."""
    names = {"patient": patient.nickname}
    if patient.ended_at is not None:
        message = gettext(
            "%(patient)s's program has ended. Reopen it on the page “Consent and data” first."
        )
        raise InvalidSetting(message % names)
    if is_care_allowed(patient):
        return
    message = gettext(
        "%(patient)s has not agreed to care, and this clinic needs that. Note it on the page "
        "“Consent and data” first."
    )
    raise InvalidSetting(message % names)


def _check_not_blinded(patient: Patient, by: User | None) -> None:
    """Raise InvalidSetting where the account would learn what a study hides."""
    if by is not None and hidden_patients(by).filter(pk=patient.pk).exists():
        message = gettext(
            "You assess %(patient)s without knowing the study's arm. Ask a colleague who treats "
            "to set this session up."
        )
        raise InvalidSetting(message % {"patient": patient.nickname})


def change_session(
    session: TrainingSession, kind: str, value: ChangeValue = None, by: User | None = None
) -> None:
    """Start, pause, steer or end a session from a page; committed when this returns.

    Raises InvalidSetting where the change is refused (nothing has happened then), NotStored where
    it could not be committed, and OwnedElsewhere where another process runs the session.
    """
    if kind == ChangeKind.PAUSE and by is not None:
        value = PauseReason.THERAPIST.value
    async_to_sync(_order)(session.pk, ChangeOrder(kind, value, by))


def acknowledge(session: TrainingSession, kind: Alarm, by: User) -> None:
    """Acknowledge the alarms of a kind of a session; committed when this returns.

    Raises NotStored and OwnedElsewhere as `change_session` does.
    """
    rows = SessionEvent.everywhere.filter(session=session, kind__in=ALARM_KINDS).order_by("pk")
    if any(event.kind == kind for event in OpenAlarms(rows).events):
        async_to_sync(_order)(session.pk, RemarkOrder(ACKNOWLEDGMENTS[kind], None, by))


def stop_robot(session: TrainingSession, by: User) -> None:
    """Stop the robot of a session, and of the others at its station.

    Raises NotStored and OwnedElsewhere as `change_session` does.
    """
    async_to_sync(_stop_robot)(session.pk, by)


async def _stop_robot(session_id: int, by: User) -> None:
    async with _running() as live:
        live.robots.stop(await live.session(session_id), by, {})


async def _order(session_id: int, order: Order) -> None:
    async with _running() as live:
        await live.order(session_id, order)


@asynccontextmanager
async def _running() -> AsyncIterator[runtime.Runtime]:
    """Return the server's runtime; of a command one that leaves nothing running."""
    in_server = runtime.peek() is not None
    live = runtime.current()
    try:
        yield live
    finally:
        if not in_server:
            await live.drain()
