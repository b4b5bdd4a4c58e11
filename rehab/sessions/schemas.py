"""Request and response schemas of the API's session calls."""

from __future__ import annotations

from datetime import datetime
from typing import Annotated, Any, ClassVar, Literal

from ninja import Field, ModelSchema, Schema
from pydantic import AfterValidator

from rehab.people.api import PatientName, ShortText
from rehab.people.web.api_base import (
    AwareDatetime,
    Key,
    Paging,
    RequestBody,
    StrictInt,
    TextLine,
    may_see_names,
    optional,
)
from rehab.sessions.log import STEP_COLUMNS, SessionMetric, Step
from rehab.sessions.models import TrainingSession
from rehab.sessions.setup.walking import MAX_DEVICE_LETTERS
from rehab.training.adaptation import AdaptationMode
from rehab.training.changes import State
from rehab.training.controls import requestable_kinds
from rehab.training.cueing import CueRule
from rehab.training.schedules import ScheduleKind
from rehab.training.steps import Side
from rehab.training.summary.metrics import METRICS
from rehab.training.valences import VALENCES, find_valence

STEPS_MAX = 1000
ShortLine = Annotated[TextLine, Field(max_length=MAX_DEVICE_LETTERS)]
ValenceSlug = Annotated[
    str,
    AfterValidator(lambda slug: find_valence(slug).slug),
    Field(json_schema_extra={"enum": list(VALENCES)}),
]


def parse_change_kind(kind: str) -> str:
    """Return the kind of change. Raises ValueError for one that a client cannot request."""
    known = requestable_kinds()
    if kind not in known:
        raise ValueError(f"A change is one of: {', '.join(known)}.")
    return kind


RequestedChangeKind = Annotated[
    str, AfterValidator(parse_change_kind), Field(json_schema_extra={"enum": requestable_kinds()})
]


class NamedRow(Schema):
    """Something that a session can be built with."""

    id: int
    name: str


class SessionOut(Schema):
    """A session. Score and hit rate come when it is finished; explicit feedback has no score."""

    id: int
    patient: PatientName
    state: str
    feedback_type: str = Field(alias="valence", description="The one that it began with.")
    changed_to: list[str] = Field(
        alias="later_valences", description="Types that it was changed to on its way, in order."
    )
    goal: float | None
    measure: str = Field(alias="measure.name")
    unit: str = Field(alias="measure.unit")
    trained_side: str | None
    protocol: str | None = Field(None, alias="protocol.name")
    station: str | None = Field(None, alias="station.name")
    source: str | None = Field(description="Null for researchers: files may be named after people.")
    simulated: bool
    excluded: bool = Field(description="Corrected: in no figure, board or trend.")
    imported: bool = Field(description="From the original GARRY, without steps.")
    device: str
    belt_speed_m_s: float | None
    weight_support_percent: float | None
    created_at: datetime
    started_at: datetime | None
    ended_at: datetime | None
    active_s: float
    score: float | None = Field(alias="metric_score")
    hit_rate: float | None = Field(alias="metric_hit_rate")

    @staticmethod
    def resolve_imported(session: TrainingSession) -> bool:
        """Return whether it was imported from the original GARRY."""
        return session.legacy_id is not None

    @staticmethod
    def resolve_source(session: TrainingSession, context: Any) -> str | None:
        """Return where its steps come from, to those who may see the patient's name."""
        return session.source if may_see_names(context) else None

    @staticmethod
    def resolve_trained_side(session: TrainingSession) -> str | None:
        """Return the trained leg; null where the original did not store it."""
        return session.trained_side or None


class SessionFilter(Paging):
    """Which sessions are wanted, and in which order."""

    patient: Key | None = None
    pseudonym: ShortText | None = None
    feedback_type: ValenceSlug | None = None
    state: State | None = None
    since: AwareDatetime | None = Field(None, description="Created at this moment or later.")
    until: AwareDatetime | None = Field(None, description="Created before this moment.")
    order: Literal["newest", "oldest", "best"] = "newest"


class MeasureOut(Schema):
    """A quantity of a stride that can be trained."""

    id: int
    slug: str
    name: str
    unit: str
    value_min: float
    value_max: float
    goal_min: float
    goal_max: float
    higher_is_better: bool
    channel: str = Field(description="The extra value that holds it; empty: the step's value.")


class SessionRequestBody(RequestBody):
    """A new session. What is left out is like the patient's last time."""

    patient: Key
    feedback_type: ValenceSlug = optional()
    measure: Key = optional(description="What is trained, as `GET /measures` lists it.")
    goal: float = optional(description="In the measure's unit, or give `goal_percent`.")
    goal_percent: float = optional(description="Percent of the baseline.")
    wanted_hits: StrictInt | None = Field(None, description="Percent of the steps.")
    minutes: StrictInt | None = None
    protocol: Key = optional()
    station: Key = optional()
    source: TextLine = optional(description="`live`, `synthetic good`, `recording walk.csv`, …")
    trained_side: Side = optional(strict=False)
    robot: TextLine = optional(description="As in the set-up: `off`, `gentle`, `normal`.")
    robot_above: TextLine = optional(description="Gesture after a window above the threshold.")
    robot_below: TextLine = optional(description="Gesture after a window below it.")
    device: ShortLine = optional(description="What the patient walks on or with.")
    belt_speed: float | None = Field(None, description="Of the treadmill, m/s.")
    weight_support: float | None = Field(None, description="Percent of the body's weight.")
    robot_threshold: StrictInt = optional(description="Percent of the goal, 1 to 200.")
    robot_answers: CueRule = optional(strict=False, description="What a gesture answers.")
    robot_window: float = optional(description="Seconds of a window, 2 to 60.")
    robot_count: StrictInt = optional(description="Steps of a streak or group, 1 to 100.")
    robot_rest: float = optional(description="Least seconds between two gestures, 0 to 600.")
    schedule: ScheduleKind = optional(strict=False, description="When the patient is told.")
    schedule_steps: StrictInt = optional(
        description="Told after each so many steps; of `faded` the most, of `summary` the block."
    )
    schedule_band: StrictInt = optional(
        description="`bandwidth`: told outside of ± so many percent of the goal, 1 to 50."
    )
    goal_follows: AdaptationMode = optional(
        strict=False, description="Whether the goal stays, is suggested or follows by itself."
    )
    goal_asks: bool = optional(
        description="Whether a therapist accepts the baseline's goal before it counts."
    )


class ChangeRequestBody(RequestBody):
    """What is to be changed of a session, as on the therapist's page."""

    kind: RequestedChangeKind
    value: float | str | None = Field(
        None,
        description="The new goal, gain, threshold, intensity or phase; 1 or 0 for words shown; "
        "the name of a valence or chart style; nothing for the others.",
    )


class StepOut(ModelSchema):
    """A scored stride: all that is stored of it."""

    reasons: list[str]
    extra: dict[str, float]

    class Meta:
        """All fields but the keys."""

        model = Step
        fields: ClassVar = [column.field for column in STEP_COLUMNS]


class StepPage(Schema):
    """Steps in their order. `next_after` is where to go on; null at the end (so far)."""

    items: list[StepOut]
    next_after: int | None


class StepFilter(Schema):
    """Which steps are wanted."""

    after: int = Field(0, ge=0, lt=2**31)
    limit: int = Field(200, ge=1, le=STEPS_MAX)


class MetricOut(Schema):
    """A figure of a finished session."""

    slug: str
    label: str
    unit: str
    value: float

    @staticmethod
    def resolve_label(metric: SessionMetric) -> str:
        """Return the figure's name."""
        return METRICS[metric.slug].label

    @staticmethod
    def resolve_unit(metric: SessionMetric) -> str:
        """Return the figure's unit; empty for a ratio or a count."""
        return METRICS[metric.slug].unit
