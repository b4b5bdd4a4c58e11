"""What a PT fills in before a session: who walks, and how the session is set up."""

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
from rehab.people.web.refusals import in_words
from rehab.sessions.cues import USUAL, list_gestures, to_choices, to_cue
from rehab.sessions.formatting import LEVELS, say_source
from rehab.sessions.log import SessionEvent
from rehab.sessions.models import TrainingSession
from rehab.sessions.protocols import Protocol
from rehab.sessions.services import StationTaken, check_station, create_session
from rehab.sessions.step_sources import LIVE, list_sources, source_arguments
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
# Mean A2 of a healthy walk in the recordings (docs/reference/gait.md#protocol): where a first goal
# begins.
FIRST_GOAL_W_KG = 3.9
TRAINING_ONLY, WITH_BASELINE = "Training only", "Baseline, training, washout"


class NumberField(forms.FloatField):
    """A number, with a point or a comma."""

    def to_python(self, value: Any) -> Any:
        """Read it."""
        return super().to_python(value.replace(",", ".") if isinstance(value, str) else value)


class SessionForm(forms.Form):
    """Everything a session of one patient needs. Nothing has to be typed."""

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
        choices=[(level, capfirst(LEVELS[level])) for level in ROBOT_LEVELS],
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
        fields["source"].choices = [(name, say_source(words)) for name, words in list_sources()]
        fields["robot_above"].choices = fields["robot_below"].choices = list_gestures(by)

    def clean_station(self) -> Station:
        """Refuse a station where somebody else may be walking right now."""
        station: Station = self.cleaned_data["station"]
        try:
            check_station(station)
        except StationTaken as problem:
            raise ValidationError(in_words(problem)) from problem
        return station

    def clean_source(self) -> str:
        """Refuse a recording that cannot be played, in its reader's own words."""
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
            self.patient,
            valence=data["valence"],
            goal=GoalRule(
                value=data["goal_value"] if by_value else None,
                percent_of_baseline=None if by_value else data["goal_percent"],
            ),
            protocol=data["protocol"],
            trained_side=Side(data["trained_side"]),
            target=Target(
                hit_rate=hits / 100 if hits else None, duration_s=minutes * 60 if minutes else None
            ),
            cue=to_cue(data["robot_above"], data["robot_below"], data["valence"], self.patient),
            robot_intensity=ROBOT_LEVELS[data["robot"]],
            station=data["station"],
            created_by=self.by,
            source=dict(list_sources()).get(data["source"], ""),
            simulated=kind == "synthetic",
            runs=source_arguments(kind, name, self.patient),
        )

    def create(self) -> TrainingSession | None:
        """Create the session, or give None and say in ``errors`` what hinders."""
        if not self.is_valid():
            return None
        try:
            return self.save()
        except StationTaken as problem:  # just now, by somebody else
            self.add_error("station", in_words(problem))
        except InvalidSetting as problem:
            self.add_error(None, in_words(problem))
        return None


# Usual stride time of the recordings (docs/reference/gait.md#phases), to tell how long a phase of
# strides takes.
STRIDE_S = 1.1


def minutes_of(protocol: Protocol | None) -> int | None:
    """Give how long a protocol takes; None where a phase lasts until the PT moves on."""
    total_s = 0.0
    for phase in () if protocol is None else protocol.to_rules():
        limits = [phase.seconds, phase.strides and phase.strides * STRIDE_S]
        known = [limit for limit in limits if limit]
        if not known:
            return None
        total_s += min(known)
    return math.ceil(total_s / 60) or None


def _free(stations: QuerySet[Station]) -> Station | None:
    """Give the first station where nobody has an open session, or else the first."""
    taken = stations.filter(sessions__state__in=[state.value for state in OPEN_STATES])
    return stations.exclude(pk__in=taken.values("pk")).first() or stations.first()


def like_last_time(patient: Patient, by: User) -> dict[str, Any]:
    """Give what the set-up begins with: the patient's last session, or sensible first values."""
    stations = Station.objects.visible_to(by)
    words = dict(list_sources())
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
            "minutes": minutes_of(protocol) or PLANNED_MINUTES,
            "protocol": protocol,
            "station": _free(stations),
            "source": (source := "synthetic good" if patient.simulated else LIVE),
            "source_words": say_source(words[source]),
            "trained_side": patient.paretic_side or Side.LEFT.value,
            "robot": "normal",
            "robot_above": USUAL,
            "robot_below": USUAL,
        }
    plan = last.to_plan()
    source = next((name for name, label in words.items() if label == last.source), LIVE)
    if last.runs and not patient.simulated:
        source = LIVE  # one trial with a simulator makes nobody a simulated patient
    hits, seconds = plan.target.hit_rate, plan.target.duration_s
    above, below = to_choices(plan.valence.cue, last.valence, patient, by)
    return {
        "valence": last.valence,
        "goal_by": "percent" if plan.goal.needs_baseline else "value",
        "goal_value": round(last.goal if last.goal is not None else FIRST_GOAL_W_KG, 2),
        "goal_percent": plan.goal.percent_of_baseline or 100,
        "wanted_hits": round(100 * hits) if hits else None,
        "minutes": round(seconds / 60) if seconds else None,
        "protocol": last.protocol,
        "station": last.station or _free(stations),
        "source": source,
        "source_words": say_source(words[source]),
        "trained_side": last.trained_side,
        "robot": name_robot_level(_last_intensity(last, by)),
        "robot_above": above,
        "robot_below": below,
    }


def _last_intensity(session: TrainingSession, by: User) -> float:
    """Give how the robot answered at the end of a session."""
    changes = SessionEvent.objects.visible_to(by).filter(
        session=session, kind=ChangeKind.ROBOT_INTENSITY.value
    )
    last = changes.order_by("-pk").values_list("value", flat=True).first()
    return session.to_plan().robot_intensity if last is None else last
