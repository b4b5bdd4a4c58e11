"""What is known of a control: who may use it and when, what it does, who is notified and how."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from enum import StrEnum
from typing import Any, Protocol

from rehab.training.changes import (
    OPEN_STATES,
    STATE_LABELS,
    ChangeValue,
    NotAllowed,
    PauseReason,
    State,
)
from rehab.training.measures import InvalidSetting
from rehab.training.plans import (
    SessionPlan,
)
from rehab.training.valences import Valence
from robot.marking import AnyOf, Marked


class Audience(StrEnum):
    """Who is notified of a session's events."""

    PATIENT = "patient"
    MONITOR = "monitor"
    ROBOT = "robot"
    SOURCE = "source"


class Payload(StrEnum):
    """What an audience is sent of a change; ``rehab.sessions.events`` builds each."""

    KIND = "kind"  # that it happened
    LANGUAGE = "language"  # of the words that are now in force
    VALUE = "value"  # the value that is now in force
    STATE = "state"  # the session's state and who paused it
    PHASE = "phase"  # the phase that the next step falls in
    TYPES = "types"  # feedback types: in force, next, possible
    CUE = "cue"  # the robot's order
    STOP = "stop"  # that the session has ended


class Requester(StrEnum):
    """Who may ask for a change."""

    MONITOR = "monitor"  # the PT's page, and programs that call the API
    PATIENT_PAGE = "patient_page"  # a person who is signed in, on the patient's page
    TABLET = "tablet"  # the station's paired tablet, without a signed-in person


class ValueKind(StrEnum):
    """What a change's value is."""

    NONE = "none"
    NUMBER = "number"
    NAME = "name"
    MAPPING = "mapping"


class ValueFormat(StrEnum):
    """How people read a value (``rehab.sessions.control_text``, ``monitor/annotations.js``)."""

    NONE = "none"
    NUMBER = "number"  # two decimal places
    QUANTITY = "quantity"  # with the measure's unit
    PERCENT = "percent"
    CHOICE = "choice"  # the label that ``choices`` has for it
    PHASE = "phase"  # the name of the phase of that index


class Valences(Protocol):
    """A session's valences; ``ValenceCourse`` is one."""

    current: Valence
    next_slug: str

    def edit_text(self, value: object) -> None:
        """Replace the bands of a valence."""


class ControlledSession(Protocol):
    """What controls read and alter of a session; ``SessionFold`` is one."""

    plan: SessionPlan
    settings: dict[str, Any]
    goal: float | None
    gain: float
    obstacle: str
    phase_index: int

    @property
    def valences(self) -> Valences:
        """The session's feedback types."""

    def enter_phase(self, index: int) -> None:
        """Begin a phase."""

    def pause(self, reason: PauseReason | None) -> None:
        """Note that walking stopped, and why."""

    def resume(self) -> None:
        """Clear why the session was paused."""

    def schedule_valence(self, slug: object) -> None:
        """Schedule the valence of the next phase with feedback."""

    def switch_valence(self, slug: object) -> None:
        """Change the valence from the next step on."""


Choices = Mapping[float | str, str]


@dataclass(frozen=True, slots=True)
class ChartMark:
    """How a chart of the PT's page points out a change.

    Attributes
    ----------
    badge
        One or two letters or a sign, in a circle above the strides.
    label
        Its name in the legend, before the value.
    value_format, choices
        How the value is written; as for ``Control``.
    """

    badge: str
    label: str
    value_format: ValueFormat = ValueFormat.NONE
    choices: Choices = field(default_factory=dict)


@dataclass(frozen=True, slots=True, kw_only=True)
class Control:
    """One thing that can be changed of a session.

    A control without ``apply`` and ``current`` is a setting: the session has its value in
    ``settings``, at first ``initial``.

    Attributes
    ----------
    kind
        Its name in requests, events and the log.
    log_label, review_label
        What the log's admin and the review of a session call it.
    allowed_in, leads_to
        The states it may come in; the state it leads to, None where the state stays.
    value, check
        What its value is. ``check`` returns the value to store, or raises InvalidSetting.
    initial
        A setting's value at the beginning of a plan.
    apply, current
        Put a checked value into force; return the value in force.
    payloads
        Who is notified of it, and with what.
    event_field
        The name that its event gives the value.
    snapshot_field, snapshot_for
        The name that snapshots give the value, and whose snapshots have it.
    requesters
        Who may ask for it; empty where only the server makes such changes.
    value_format, choices, shows_old, joint
        How a review writes the value: ``choices`` are the labels of single values, ``shows_old``
        writes "old → new", ``joint`` stands between label and value.
    shown_part
        The part of a mapping that reviews and marks show.
    mark
        How charts point it out; None where they do not.
    when_locked
        The values that it may still get where the plan is locked; None where that locks nothing.
    """

    kind: str
    log_label: str
    review_label: str
    allowed_in: frozenset[State] = OPEN_STATES
    leads_to: State | None = None
    value: ValueKind = ValueKind.NONE
    check: Callable[[Any], Any] | None = None
    initial: Callable[[SessionPlan], Any] | None = None
    apply: Callable[[ControlledSession, Any], None] | None = None
    current: Callable[[ControlledSession], Any] | None = None
    payloads: Mapping[Audience, Payload] = field(
        default_factory=lambda: {Audience.MONITOR: Payload.VALUE}
    )
    event_field: str = "value"
    snapshot_field: str = ""
    snapshot_for: frozenset[Audience] = frozenset({Audience.MONITOR})
    requesters: frozenset[Requester] = frozenset({Requester.MONITOR})
    value_format: ValueFormat = ValueFormat.NONE
    choices: Choices = field(default_factory=dict)
    shows_old: bool = False
    joint: str = ": "
    shown_part: str = ""
    mark: ChartMark | None = None
    when_locked: frozenset[float] | None = None

    def check_lock(self, plan: SessionPlan, value: ChangeValue) -> None:
        """Raise NotAllowed where a locked plan fixes what the change would alter."""
        if not plan.locked or self.when_locked is None:
            return
        if not isinstance(value, int | float) or value not in self.when_locked:
            raise NotAllowed(
                "This session belongs to a study, which fixes the {what}. For safety you can "
                "always pause or end the session, stop the robot or switch it off: the study's "
                "results tell it.",
                what=Marked(self.log_label),
            )

    def next_state(self, state: State) -> State:
        """Return the state after the change.

        Raises
        ------
        NotAllowed
            Naming the states in which the change would be allowed.
        """
        if state not in self.allowed_in:
            raise NotAllowed(
                "A session that is {state} cannot take the change '{kind}'; it must be {allowed}.",
                state=Marked(STATE_LABELS[state]),
                kind=Marked(self.kind),
                allowed=AnyOf(sorted(STATE_LABELS[each] for each in self.allowed_in)),
            )
        return self.leads_to or state

    def put_into_force(self, session: ControlledSession, value: ChangeValue) -> None:
        """Check a value and apply it to a session. Raises InvalidSetting, changing nothing."""
        if self.value is ValueKind.NUMBER:
            value = self._check_number(value)
        checked = value if self.check is None else self.check(value)
        if self.apply is not None:
            self.apply(session, checked)
        elif self.initial is not None:
            session.settings[self.kind] = checked

    def _check_number(self, value: object) -> float:
        # JSON knows true and false beside numbers.
        if isinstance(value, bool) or not isinstance(value, int | float):
            raise InvalidSetting(
                "The change '{kind}' needs a value, and that is a number.", kind=Marked(self.kind)
            )
        return value

    def value_in_force(self, session: ControlledSession) -> Any:
        """Return the value as pages get it; None where the control has none."""
        if self.current is not None:
            return self.current(session)
        return session.settings.get(self.kind)

    def value_for_log(self, session: ControlledSession) -> float | str | None:
        """Return the value in force as the log stores it: a number or a name."""
        value = self.value_in_force(session)
        if isinstance(value, str):
            return str(value)
        return float(value) if isinstance(value, bool) else value

    def part_shown(self, value: ChangeValue) -> float | str | None:
        """Return what reviews and marks show of a change's value."""
        return value.get(self.shown_part) if isinstance(value, Mapping) else value
