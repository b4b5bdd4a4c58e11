"""What people do with sessions: create them and change them."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import replace

from asgiref.sync import async_to_sync
from django.db import transaction
from django.utils.translation import gettext

from rehab.feedback.valences import valences_of
from rehab.people.consent.models import may_be_cared_for
from rehab.people.models import Patient, User
from rehab.sessions.cues import find_composed, quiet_cue
from rehab.sessions.live import runtime
from rehab.sessions.models import TrainingSession
from rehab.sessions.protocols import Measure, Protocol
from rehab.stations.models import Station
from rehab.training.changes import OPEN_STATES, ChangeKind, ChangeValue, PauseReason
from rehab.training.goals import GoalRule, Target
from rehab.training.measures import A2, InvalidSetting
from rehab.training.phases import Phase
from rehab.training.plans import DEFAULT_ACTIVATION_THRESHOLD, SessionPlan
from rehab.training.steps import Side
from rehab.training.valences import CueGestures, Valence, find_valence


class StationTaken(InvalidSetting):
    """A session is open at this station: its tablet shows one, and its sensor feeds one."""


def check_station(station: Station) -> None:
    """Raise StationTaken where a session is open at a station."""
    states = [state.value for state in OPEN_STATES]
    taken = TrainingSession.everywhere.filter(
        station=station, clinic=station.clinic_id, state__in=states
    )
    if (session := taken.select_related("patient").first()) is not None:
        said = gettext(
            "%(station)s still has an open session of %(patient)s. End it first, or choose "
            "another station."
        )
        raise StationTaken(said % {"station": station, "patient": session.patient})


def create_session(
    patient: Patient,
    *,
    valence: str,
    goal: GoalRule,
    phases: Iterable[Phase] | None = None,
    protocol: Protocol | None = None,
    measure: Measure | None = None,
    trained_side: Side | None = None,
    target: Target | None = None,
    activation_threshold: float = DEFAULT_ACTIVATION_THRESHOLD,
    cue: CueGestures | None = None,
    robot_intensity: float = 1.0,
    station: Station | None = None,
    created_by: User | None = None,
    source: str = "",
    simulated: bool = False,
    runs: Sequence[str] = (),
) -> TrainingSession:
    """Create a session that is ready to start, with everything it will be scored with.

    Phases are given, or come from the protocol; the robot's cue is given, or the feedback type's.
    Feedback is the clinic's own, in the patient's language.
    ``runs`` are arguments of `python -m rehab.sources` for a source that the server runs beside the
    session. Raises InvalidSetting for a plan that could not be walked, StationTaken, and
    CrossClinic where patient, station and the rest are not of one clinic; nothing is stored then.
    """
    measure = measure or Measure.everywhere.get(clinic=None, slug=A2.slug)
    if phases is None:
        if protocol is None:
            raise InvalidSetting(gettext("A session needs a protocol, or phases of its own."))
        phases = protocol.to_rules()
    side = trained_side or (Side(patient.paretic_side) if patient.paretic_side else None)
    if side is None:
        raise InvalidSetting(
            gettext("Which leg is trained? Set the paretic side of %(patient)s, or choose a leg.")
            % {"patient": patient}
        )
    find_valence(valence)
    known = valences_of(patient.clinic_id, patient.language)
    usual = known.pop(valence)
    rules = usual if cue is None else replace(usual, cue=cue)
    composed = {one["name"]: one for one in find_composed(patient, rules.cue)}
    alternatives: list[Valence] = []
    for other in known.values():
        their_cue = quiet_cue(other.cue, usual.cue, rules.cue)
        try:
            composed |= {one["name"]: one for one in find_composed(patient, their_cue)}
        except InvalidSetting:  # a gesture that is gone: it hinders no session of another type
            their_cue = CueGestures()
        alternatives.append(replace(other, cue=their_cue))
    plan = SessionPlan(
        measure=measure.to_rule(),
        valence=rules,
        phases=tuple(phases),
        trained_side=side,
        goal=goal,
        target=target or Target(),
        activation_threshold=activation_threshold,
        robot_intensity=robot_intensity,
        gestures=tuple(composed.values()),
        alternatives=tuple(alternatives),
        language=patient.language,
    )
    session = TrainingSession(
        clinic_id=patient.clinic_id,
        patient=patient,
        station=station,
        protocol=protocol,
        measure=measure,
        created_by=created_by,
        valence=plan.valence.slug,
        trained_side=side.value,
        source=source,
        simulated=simulated,
        runs=list(runs),
        plan=plan.to_json(),
        goal=goal.value,
    )
    with transaction.atomic():
        patient.hold()  # nobody is erased meanwhile
        _check_may_walk(patient)
        if station is not None and station.clinic_id == patient.clinic_id:
            # Two who set up at once: the second waits here, and then sees the first one's session.
            Station.everywhere.select_for_update(no_key=True).get(pk=station.pk)
            check_station(station)
        session.save()
    live = runtime.peek()
    if live is not None:
        live.loop.call_soon_threadsafe(live.announce, session.pk, session.station_id)
    return session


def _check_may_walk(patient: Patient) -> None:
    """Refuse a patient who has left, or who has not agreed to what the clinic needs.

    Raises InvalidSetting.
    """
    names = {"patient": patient.nickname}
    if patient.ended_at is not None:
        said = gettext(
            "%(patient)s's program has ended. Reopen it on the page “Consent and data” first."
        )
        raise InvalidSetting(said % names)
    if may_be_cared_for(patient):
        return
    said = gettext(
        "%(patient)s has not agreed to care, and this clinic needs that. Note it on the page "
        "“Consent and data” first."
    )
    raise InvalidSetting(said % names)


def change_session(
    session: TrainingSession, kind: str, value: ChangeValue = None, by: User | None = None
) -> None:
    """Start, pause, steer or end a session from a page; committed when this returns.

    Raises InvalidSetting where the change is refused (nothing has happened then), NotStored where
    it could not be committed, and OwnedElsewhere where another process runs the session.
    """
    if kind == ChangeKind.PAUSE and by is not None:
        value = PauseReason.THERAPIST.value
    async_to_sync(_change)(session.pk, kind, value, by)


async def _change(session_id: int, kind: str, value: ChangeValue, by: User | None) -> None:
    serves = runtime.peek() is not None  # else a command: what it starts must not outlive it
    here = runtime.current()
    try:
        await here.change(session_id, kind, value, by)
    finally:
        if not serves:
            await here.drain()
