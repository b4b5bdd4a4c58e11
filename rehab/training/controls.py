"""The registry of controls: everything that other code knows of a control of the PT's page.

From an entry follow the states that allow the change, what it does to the fold, who may ask for it
(pages and the API), what each audience is told, its row in the log, its line in a review and its
mark on charts. A control that no other code names needs no member of ``ChangeKind``.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from enum import StrEnum
from typing import Any, Protocol

from rehab.training.changes import (
    OPEN_STATES,
    STATE_LABELS,
    ChangeKind,
    ChangeValue,
    NotAllowed,
    PauseReason,
    State,
)
from rehab.training.marking import AnyOf, Marked, gettext_noop
from rehab.training.measures import InvalidSetting, check_gain
from rehab.training.plans import (
    ROBOT_LEVELS,
    ChartStyle,
    SessionPlan,
    check_activation_threshold,
    check_chart_style,
    check_robot_intensity,
)
from rehab.training.valences import VALENCES, Valence


class Audience(StrEnum):
    """Who is told of a session's events."""

    PATIENT = "patient"
    MONITOR = "monitor"
    ROBOT = "robot"
    SOURCE = "source"


class Payload(StrEnum):
    """What an audience is told of a change; ``rehab.sessions.events`` builds each."""

    KIND = "kind"  # that it happened
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
    TABLET = "tablet"  # the station's paired tablet, with nobody signed in


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


class ControlledSession(Protocol):
    """What controls read and alter of a session; ``SessionFold`` is one."""

    plan: SessionPlan
    settings: dict[str, Any]
    goal: float | None
    gain: float
    obstacle: str
    phase_index: int
    valence: Valence
    next_valence: str

    def enter_phase(self, index: int) -> None:
        """Begin a phase."""

    def pause(self, reason: PauseReason | None) -> None:
        """Note that nobody walks, and why."""

    def resume(self) -> None:
        """Forget why the session was paused."""

    def schedule_valence(self, slug: object) -> None:
        """Schedule the valence of the next phase with feedback."""

    def edit_feedback_text(self, value: object) -> None:
        """Replace the bands of a valence."""


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

    A control without ``apply`` and ``current`` is a setting: the session keeps its value in
    ``settings``, from ``initial`` on.

    Attributes
    ----------
    kind
        Its name in requests, events and the log.
    log_label, review_label
        What the log's admin and the review of a session call it.
    allowed_in, leads_to
        The states it may come in; the state it leads to, None where the state stays.
    value, check
        What its value is. ``check`` returns the value that is kept, or raises InvalidSetting.
    initial
        A setting's value at the beginning of a plan.
    apply, current
        Put a checked value into force; return the value in force.
    tells
        Who is told of it, and what.
    event_field
        The name that its event gives the value.
    snapshot_field, snapshot_for
        The name that snapshots give the value, and whose snapshots have it.
    requesters
        Who may ask for it; nobody where only the server makes such changes.
    value_format, choices, shows_old, joint
        How a review writes the value: ``choices`` are the labels of single values, ``shows_old``
        writes "old → new", ``joint`` stands between label and value.
    shown_part
        The part of a mapping that reviews and marks show.
    mark
        How charts point it out; None where they do not.
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
    tells: Mapping[Audience, Payload] = field(
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
        """Check a value and apply it. Raises InvalidSetting; the session is then as it was."""
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
        """Return the value as pages are told it; None where the control has none."""
        if self.current is not None:
            return self.current(session)
        return session.settings.get(self.kind)

    def value_for_log(self, session: ControlledSession) -> float | str | None:
        """Return the value in force as the log keeps it: a number or a name."""
        value = self.value_in_force(session)
        if isinstance(value, str):
            return str(value)
        return float(value) if isinstance(value, bool) else value

    def part_shown(self, value: ChangeValue) -> float | str | None:
        """Return what reviews and marks show of a change's value."""
        return value.get(self.shown_part) if isinstance(value, Mapping) else value


def _check_words_shown(number: float) -> bool:
    if number not in (0, 1):
        raise InvalidSetting("Words are shown (1) or not (0).")
    return number == 1


def _set_goal(session: ControlledSession, goal: float) -> None:
    session.goal = session.plan.measure.check_goal(goal)
    session.obstacle = ""


def _set_gain(session: ControlledSession, gain: float) -> None:
    session.gain = gain


def _enter_phase(session: ControlledSession, index: float) -> None:
    session.enter_phase(session.plan.check_phase(index))


def _pause(session: ControlledSession, value: object) -> None:
    known = [reason for reason in PauseReason if reason == value]
    session.pause(known[0] if known else None)


_PATIENTS_PAGE = frozenset({Requester.MONITOR, Requester.PATIENT_PAGE})
_PAGES_AND_ROBOT = {
    Audience.PATIENT: Payload.STATE,
    Audience.MONITOR: Payload.STATE,
    Audience.ROBOT: Payload.STATE,
}
_ALL_OF_STATE = {**_PAGES_AND_ROBOT, Audience.SOURCE: Payload.KIND}
_ALL_OF_END = {**_PAGES_AND_ROBOT, Audience.SOURCE: Payload.STOP}
_MONITOR_AND_CUE = {Audience.MONITOR: Payload.VALUE, Audience.ROBOT: Payload.CUE}

_TYPES: Choices = {one.slug: one.label for one in VALENCES.values()}
_SWITCH: Choices = {1: gettext_noop("on"), 0: gettext_noop("off")}
_LEVELS: Choices = {
    ROBOT_LEVELS["normal"]: gettext_noop("normal"),
    ROBOT_LEVELS["gentle"]: gettext_noop("gentle"),
    ROBOT_LEVELS["off"]: gettext_noop("off"),
}
_CHART_STYLES: Choices = {
    ChartStyle.POINTS.value: gettext_noop("points"),
    ChartStyle.LINE.value: gettext_noop("line"),
}
_PAUSE_REASONS: Choices = {
    PauseReason.THERAPIST.value: gettext_noop("by the therapist"),
    PauseReason.PATIENT.value: gettext_noop("on the patient’s page"),
    PauseReason.RESTART.value: gettext_noop("by a restart of the server"),
}

CONTROLS: dict[str, Control] = {
    control.kind: control
    for control in (
        Control(
            kind=ChangeKind.START,
            log_label=gettext_noop("start"),
            review_label=gettext_noop("Started"),
            allowed_in=frozenset({State.READY}),
            leads_to=State.RUNNING,
            tells=_ALL_OF_STATE,
            requesters=_PATIENTS_PAGE,
        ),
        Control(
            kind=ChangeKind.PAUSE,
            log_label=gettext_noop("pause"),
            review_label=gettext_noop("Paused"),
            allowed_in=frozenset({State.RUNNING}),
            leads_to=State.PAUSED,
            apply=_pause,
            tells=_ALL_OF_STATE,
            requesters=frozenset(Requester),
            value_format=ValueFormat.CHOICE,
            choices=_PAUSE_REASONS,
            joint=" ",
            mark=ChartMark("‖", gettext_noop("pause")),
        ),
        Control(
            kind=ChangeKind.RESUME,
            log_label=gettext_noop("resume"),
            review_label=gettext_noop("Resumed"),
            allowed_in=frozenset({State.PAUSED}),
            leads_to=State.RUNNING,
            apply=lambda session, _value: session.resume(),
            tells=_ALL_OF_STATE,
            requesters=_PATIENTS_PAGE,
            mark=ChartMark("▸", gettext_noop("went on")),
        ),
        Control(
            kind=ChangeKind.FINISH,
            log_label=gettext_noop("finish"),
            review_label=gettext_noop("Finished"),
            allowed_in=frozenset({State.RUNNING, State.PAUSED}),
            leads_to=State.FINISHED,
            tells=_ALL_OF_END,
            requesters=_PATIENTS_PAGE,
        ),
        Control(
            kind=ChangeKind.ABORT,
            log_label=gettext_noop("abort"),
            review_label=gettext_noop("Ended early"),
            leads_to=State.ABORTED,
            tells=_ALL_OF_END,
        ),
        Control(
            kind=ChangeKind.GOAL,
            log_label=gettext_noop("goal"),
            review_label=gettext_noop("Goal"),
            value=ValueKind.NUMBER,
            apply=_set_goal,
            current=lambda session: session.goal,
            tells={Audience.MONITOR: Payload.VALUE, Audience.SOURCE: Payload.VALUE},
            event_field="goal",
            snapshot_field="goal",
            value_format=ValueFormat.QUANTITY,
            shows_old=True,
            mark=ChartMark("⚑", gettext_noop("goal"), ValueFormat.NUMBER),
        ),
        Control(
            kind=ChangeKind.GAIN,
            log_label=gettext_noop("gain"),
            review_label=gettext_noop("Gain"),
            value=ValueKind.NUMBER,
            check=check_gain,
            apply=_set_gain,
            current=lambda session: session.gain,
            event_field="gain",
            snapshot_field="gain",
            value_format=ValueFormat.NUMBER,
            shows_old=True,
            mark=ChartMark("G", gettext_noop("gain"), ValueFormat.NUMBER),
        ),
        Control(
            kind=ChangeKind.PHASE,
            log_label=gettext_noop("phase"),
            review_label=gettext_noop("Phase"),
            value=ValueKind.NUMBER,
            apply=_enter_phase,
            current=lambda session: session.phase_index,
            tells={
                Audience.PATIENT: Payload.PHASE,
                Audience.MONITOR: Payload.PHASE,
                Audience.SOURCE: Payload.PHASE,
            },
            value_format=ValueFormat.PHASE,
        ),
        Control(
            kind=ChangeKind.ACTIVATION_THRESHOLD,
            log_label=gettext_noop("activation threshold"),
            review_label=gettext_noop("Robot threshold"),
            value=ValueKind.NUMBER,
            check=check_activation_threshold,
            initial=lambda plan: plan.activation_threshold,
            tells=_MONITOR_AND_CUE,
            snapshot_field="activation_threshold",
            value_format=ValueFormat.PERCENT,
            shows_old=True,
            mark=ChartMark("A", gettext_noop("robot acts from"), ValueFormat.PERCENT),
        ),
        Control(
            kind=ChangeKind.ROBOT_INTENSITY,
            log_label=gettext_noop("robot intensity"),
            review_label=gettext_noop("Robot"),
            value=ValueKind.NUMBER,
            check=check_robot_intensity,
            initial=lambda plan: plan.robot_intensity,
            tells=_MONITOR_AND_CUE,
            snapshot_field="robot_intensity",
            value_format=ValueFormat.CHOICE,
            choices=_LEVELS,
            shows_old=True,
            mark=ChartMark("R", gettext_noop("robot"), ValueFormat.CHOICE, _LEVELS),
        ),
        Control(
            kind=ChangeKind.VALENCE,  # of the next phase with feedback
            log_label=gettext_noop("feedback type"),
            review_label=gettext_noop("Next feedback type"),
            value=ValueKind.NAME,
            apply=lambda session, slug: session.schedule_valence(slug),
            current=lambda session: session.next_valence or session.valence.slug,
            tells={Audience.MONITOR: Payload.TYPES},
            value_format=ValueFormat.CHOICE,
            choices=_TYPES,
            mark=ChartMark("N", gettext_noop("next type"), ValueFormat.CHOICE, _TYPES),
        ),
        Control(
            kind=ChangeKind.FEEDBACK_TEXT,  # edited with its feedback type, for all open sessions
            log_label=gettext_noop("words"),
            review_label=gettext_noop("Words edited"),
            value=ValueKind.MAPPING,
            apply=lambda session, value: session.edit_feedback_text(value),
            tells={Audience.MONITOR: Payload.KIND},
            requesters=frozenset(),
            value_format=ValueFormat.CHOICE,
            choices=_TYPES,
            shown_part="valence",
            mark=ChartMark("E", gettext_noop("words edited")),
        ),
        Control(
            kind=ChangeKind.WORDS_SHOWN,
            log_label=gettext_noop("words shown"),
            review_label=gettext_noop("Words"),
            value=ValueKind.NUMBER,
            check=_check_words_shown,
            initial=lambda _plan: True,
            snapshot_field="words_shown",
            value_format=ValueFormat.CHOICE,
            choices=_SWITCH,
            mark=ChartMark("W", gettext_noop("words"), ValueFormat.CHOICE, _SWITCH),
        ),
        Control(
            kind=ChangeKind.CHART_STYLE,
            log_label=gettext_noop("chart style"),
            review_label=gettext_noop("Chart"),
            value=ValueKind.NAME,
            check=check_chart_style,
            initial=lambda _plan: ChartStyle.POINTS,
            snapshot_field="chart",
            snapshot_for=frozenset({Audience.PATIENT, Audience.MONITOR, Audience.ROBOT}),
            value_format=ValueFormat.CHOICE,
            choices=_CHART_STYLES,
            mark=ChartMark("C", gettext_noop("chart"), ValueFormat.CHOICE, _CHART_STYLES),
        ),
    )
}

# A phase that begins with another feedback type is pointed out too; its value is the type's label.
TYPE_MARK = ChartMark(
    "T",
    gettext_noop("feedback type"),
    ValueFormat.CHOICE,
    {one.label: one.label for one in VALENCES.values()},
)


def requestable_kinds() -> list[str]:
    """Return the kinds of change that pages and programs may ask for."""
    return [str(kind) for kind, control in CONTROLS.items() if control.requesters]


def marked_kinds() -> list[str]:
    """Return the kinds of change that charts point out."""
    return [str(kind) for kind, control in CONTROLS.items() if control.mark is not None]
