"""Request and response schemas of the API's session calls."""

from __future__ import annotations

from datetime import datetime
from enum import StrEnum
from typing import TYPE_CHECKING, Annotated, Any, ClassVar, Literal

from ninja import Field, ModelSchema, Schema
from pydantic import AfterValidator, create_model

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
from rehab.sessions.log import SessionMetric, Step
from rehab.sessions.models import TrainingSession
from rehab.sessions.setup.option import Option
from rehab.sessions.setup.options import OPTIONS
from rehab.sessions.step_columns import STEP_COLUMNS
from rehab.training.changes import State
from rehab.training.controls import requestable_kinds
from rehab.training.steps import Side
from rehab.training.summary.metrics import METRICS
from rehab.training.valences import VALENCES, find_valence

STEPS_MAX = 1000
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


class _SessionRequestRows(RequestBody):
    """A new session. What is left out is like the patient's last time."""

    patient: Key
    measure: Key = optional(description="What is trained, as `GET /measures` lists it.")
    protocol: Key = optional()
    station: Key = optional()
    trained_side: Side = optional(strict=False)


def describe_option(option: Option) -> tuple[Any, Any]:
    """Return the type and the description of a set-up option as a field of a request."""
    kind: Any = {int: StrictInt, str: TextLine}.get(option.kind, option.kind)
    if option.name == "valence":
        kind = ValenceSlug
    elif option.max_length is not None:
        kind = Annotated[TextLine, Field(max_length=option.max_length)]
    text = option.help
    if option.least is not None and option.most is not None:
        text += f" {option.least:g} to {option.most:g} {option.unit}".rstrip() + "."
    if option.kind is str and option.choices and not callable(option.choices):
        text += f" One of: {', '.join(f'`{value}`' for value, _label in option.choices)}."
    strict = {"strict": False} if issubclass(option.kind, StrEnum) else {}
    # A goal is given or left out: null would be neither of its two kinds.
    is_nullable = option.nullable and option.applies_to is None
    return kind | None if is_nullable else kind, optional(description=text, **strict)


def session_request_body() -> type[_SessionRequestRows]:
    """Return the schema of a new session, with a field for each set-up option."""
    fields: dict[str, Any] = {
        option.api_name or option.name: describe_option(option)
        for option in OPTIONS.values()
        if option.name != "goal_by"  # which of the goals was sent says it
    }
    return create_model(
        "SessionRequestBody",
        __base__=_SessionRequestRows,
        __doc__=_SessionRequestRows.__doc__,
        **fields,
    )


if TYPE_CHECKING:
    SessionRequestBody = _SessionRequestRows
else:
    SessionRequestBody = session_request_body()


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
