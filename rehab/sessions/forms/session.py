"""The form that sets a session up."""

from __future__ import annotations

import math
from typing import Any

from django import forms
from django.conf import settings
from django.core.exceptions import ValidationError
from django.db.models import QuerySet
from django.utils.text import capfirst
from django.utils.translation import gettext_lazy as _

from rehab.people.models import SIDES, Patient, User
from rehab.people.web.refusals import format_refusal
from rehab.sessions.formatting import ROBOT_LEVEL_LABELS, format_source
from rehab.sessions.log import SessionEvent
from rehab.sessions.models import TrainingSession
from rehab.sessions.services import (
    SessionRequest,
    StationTaken,
    check_station_is_free,
    create_session,
)
from rehab.sessions.setup.gestures import (
    DEFAULT_GESTURE,
    choices_from_cue,
    cue_from_choices,
    robot_gesture_choices,
)
from rehab.sessions.setup.protocols import Protocol
from rehab.sessions.setup.sources import LIVE, build_source_args, source_choices
from rehab.sources.recording import RecordingError, read_recording
from rehab.sources.recording.source import holds_signals
from rehab.stations.models import Station
from rehab.training.changes import OPEN_STATES, ChangeKind
from rehab.training.goals import GoalRule, Target
from rehab.training.measures import A2, InvalidSetting
from rehab.training.plans import ROBOT_LEVELS, name_robot_level
from rehab.training.steps import Side
from rehab.training.valences import VALENCES

# The paper's example of a goal for a whole session (docs/reference/original.md#goal-of-a-session):
# 60 % of the steps, ten minutes.
WANTED_HITS_PERCENT = 60
PLANNED_MINUTES = 10
# The goal that is offered first: mean A2 of a healthy walk in the recordings
# (docs/reference/gait.md#protocol).
FIRST_GOAL_W_KG = 3.9
TRAINING_ONLY, WITH_BASELINE = "Training only", "Baseline, training, washout"


class NumberField(forms.FloatField):
    """A number, with a point or a comma."""

    def to_python(self, value: Any) -> Any:
        """Return the number."""
        return super().to_python(value.replace(",", ".") if isinstance(value, str) else value)


class SessionForm(forms.Form):
    """The set-up of one patient's session. With its initial values it can be sent as it is."""

    valence = forms.ChoiceField(choices=[(v.slug, _(v.label)) for v in VALENCES.values()])
    goal_by = forms.ChoiceField(choices=[("value", A2.unit), ("percent", _("% of baseline"))])
    goal_value = NumberField(min_value=0.05, max_value=A2.goal_max, required=False)
    goal_percent = NumberField(min_value=50, max_value=200, required=False)
    wanted_hits = forms.IntegerField(min_value=1, max_value=100, required=False)
    minutes = forms.IntegerField(min_value=1, max_value=240, required=False)
    protocol: forms.ModelChoiceField[Protocol] = forms.ModelChoiceField(
        queryset=None, empty_label=None, widget=forms.RadioSelect
    )
    station: forms.ModelChoiceField[Station] = forms.ModelChoiceField(
        queryset=None, empty_label=None, widget=forms.RadioSelect
    )
    source = forms.ChoiceField(widget=forms.RadioSelect)
    trained_side = forms.ChoiceField(choices=SIDES, widget=forms.RadioSelect)
    robot = forms.ChoiceField(
        choices=[(level, capfirst(ROBOT_LEVEL_LABELS[level])) for level in ROBOT_LEVELS],
        widget=forms.RadioSelect,
    )
    robot_above = forms.ChoiceField()
    robot_below = forms.ChoiceField()

    def __init__(self, *args: Any, patient: Patient, by: User, **options: Any) -> None:
        super().__init__(*args, **options)
        self.patient, self.by = patient, by
        fields: dict[str, Any] = self.fields
        fields["protocol"].queryset = Protocol.objects.visible_to(by)
        fields["station"].queryset = Station.objects.visible_to(by)
        fields["source"].choices = [
            (name, format_source(label)) for name, label in source_choices()
        ]
        fields["robot_above"].choices = fields["robot_below"].choices = robot_gesture_choices(by)

    def clean_station(self) -> Station:
        """Return the station. Refuses one with an open session."""
        station: Station = self.cleaned_data["station"]
        try:
            check_station_is_free(station)
        except StationTaken as problem:
            raise ValidationError(format_refusal(problem)) from problem
        return station

    def clean_source(self) -> str:
        """Return the source. Refuses a recording that cannot be played."""
        source: str = self.cleaned_data["source"]
        kind, _between, name = source.partition(" ")
        if kind == "recording":
            file = settings.DATA_DIR / "recordings" / name
            if holds_signals(file):
                if self.patient.body_mass_kg is None:
                    raise ValidationError(
                        _(
                            "%(file)s holds raw signals, and A2 is power per kilogram: give "
                            "%(patient)s's body mass first."
                        ),
                        params={"file": name, "patient": self.patient.nickname},
                    )
                return source
            try:
                read_recording(file)
            except RecordingError as problem:
                raise ValidationError(str(problem)) from problem
        return source

    def save(self) -> TrainingSession:
        """Create the session. Raises InvalidSetting for a plan that could not be walked."""
        data = self.cleaned_data
        by_value = data["goal_by"] == "value"
        hits, minutes = data["wanted_hits"], data["minutes"]
        kind, _between, name = data["source"].partition(" ")
        return create_session(
            SessionRequest(
                patient=self.patient,
                valence=data["valence"],
                goal=GoalRule(
                    value=data["goal_value"] if by_value else None,
                    percent_of_baseline=None if by_value else data["goal_percent"],
                ),
                protocol=data["protocol"],
                trained_side=Side(data["trained_side"]),
                target=Target(
                    hit_rate=hits / 100 if hits else None,
                    duration_s=minutes * 60 if minutes else None,
                ),
                cue=cue_from_choices(
                    data["robot_above"], data["robot_below"], data["valence"], self.patient
                ),
                robot_intensity=ROBOT_LEVELS[data["robot"]],
                station=data["station"],
                created_by=self.by,
                source=dict(source_choices()).get(data["source"], ""),
                simulated=kind == "synthetic",
                source_args=build_source_args(kind, name, self.patient),
            )
        )

    def create(self) -> TrainingSession | None:
        """Create the session; return None, with the reason in ``errors``, where it cannot."""
        if not self.is_valid():
            return None
        try:
            return self.save()
        except StationTaken as problem:  # since the form was checked
            self.add_error("station", format_refusal(problem))
        except InvalidSetting as problem:
            self.add_error(None, format_refusal(problem))
        return None


# Typical stride time of the recordings (docs/reference/gait.md#phases), for the duration of a phase
# that is limited by strides.
STRIDE_S = 1.1


def protocol_minutes(protocol: Protocol | None) -> int | None:
    """Return a protocol's duration; None where a phase lasts until the PT moves on."""
    total_s = 0.0
    for phase in () if protocol is None else protocol.to_rules():
        limits = [phase.seconds, phase.strides and phase.strides * STRIDE_S]
        known = [limit for limit in limits if limit]
        if not known:
            return None
        total_s += min(known)
    return math.ceil(total_s / 60) or None


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
            "goal_by": "value" if patient.simulated else "percent",
            "goal_value": FIRST_GOAL_W_KG,
            "goal_percent": 100,
            "wanted_hits": WANTED_HITS_PERCENT,
            "minutes": protocol_minutes(protocol) or PLANNED_MINUTES,
            "protocol": protocol,
            "station": _first_free_station(stations),
            "source": (source := "synthetic good" if patient.simulated else LIVE),
            "source_words": format_source(sources[source]),
            "trained_side": patient.paretic_side or Side.LEFT.value,
            "robot": "normal",
            "robot_above": DEFAULT_GESTURE,
            "robot_below": DEFAULT_GESTURE,
        }
    plan = last.to_plan()
    source = next((name for name, label in sources.items() if label == last.source), LIVE)
    if last.source_args and not patient.simulated:
        source = LIVE  # after a trial with a simulator, a person's next session is live again
    hits, seconds = plan.target.hit_rate, plan.target.duration_s
    above, below = choices_from_cue(plan.valence.cue, last.valence, patient, by)
    return {
        "valence": last.valence,
        "goal_by": "percent" if plan.goal.needs_baseline else "value",
        "goal_value": round(last.goal if last.goal is not None else FIRST_GOAL_W_KG, 2),
        "goal_percent": plan.goal.percent_of_baseline or 100,
        "wanted_hits": round(100 * hits) if hits else None,
        "minutes": round(seconds / 60) if seconds else None,
        "protocol": last.protocol,
        "station": last.station or _first_free_station(stations),
        "source": source,
        "source_words": format_source(sources[source]),
        "trained_side": last.trained_side,
        "robot": name_robot_level(_last_intensity(last, by)),
        "robot_above": above,
        "robot_below": below,
    }


def _last_intensity(session: TrainingSession, by: User) -> float:
    """Return the robot's intensity at the end of a session."""
    changes = SessionEvent.objects.visible_to(by).filter(
        session=session, kind=ChangeKind.ROBOT_INTENSITY.value
    )
    last = changes.order_by("-pk").values_list("value", flat=True).first()
    return session.to_plan().robot_intensity if last is None else last
