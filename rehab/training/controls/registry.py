"""The registry: an entry for each thing that a PT can change while a session is open."""

from __future__ import annotations

from dataclasses import replace

from rehab.training.changes import (
    ChangeKind,
    PauseReason,
    State,
)
from rehab.training.controls.control import (
    Audience,
    ChartMark,
    Choices,
    Control,
    ControlledSession,
    Payload,
    Requester,
    ValueFormat,
    ValueKind,
)
from rehab.training.goal_adaptation import AdaptationMode, check_adaptation_mode
from rehab.training.measures import InvalidSetting, check_gain
from rehab.training.plans import (
    ROBOT_LEVELS,
    ChartStyle,
    check_chart_style,
    check_robot_intensity,
)
from rehab.training.robot_cueing import check_activation_threshold
from rehab.training.valences import VALENCES
from robot.marking import gettext_noop


def _check_words_shown(number: float) -> bool:
    if number not in (0, 1):
        raise InvalidSetting("Words are shown (1) or not (0).")
    return number == 1


def _set_goal(session: ControlledSession, goal: float) -> None:
    session.goal = session.plan.measure.check_goal(goal)
    session.obstacle = ""


def _set_adaptation(session: ControlledSession, mode: AdaptationMode) -> None:
    plan = session.plan
    replace(plan.adaptation, mode=mode).check_hit_rate(plan.target.hit_rate)
    session.settings[ChangeKind.GOAL_ADAPTATION] = mode


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
_LEVELS: Choices = {share: level for level, share in ROBOT_LEVELS.items()}
_CHART_STYLES: Choices = {
    ChartStyle.POINTS.value: gettext_noop("points"),
    ChartStyle.LINE.value: gettext_noop("line"),
}
_ADAPTATIONS: Choices = {mode.value: mode.value for mode in AdaptationMode}
_PAUSE_REASONS: Choices = {
    PauseReason.THERAPIST.value: gettext_noop("by the therapist"),
    PauseReason.PATIENT.value: gettext_noop("on the patient’s page"),
    PauseReason.RESTART.value: gettext_noop("by a restart of the server"),
    PauseReason.REST.value: gettext_noop("for a rest"),
    PauseReason.HEART_RATE.value: gettext_noop("by the limit of the heart rate"),
}

_NOTHING: frozenset[float] = frozenset()

CONTROLS: dict[str, Control] = {
    control.kind: control
    for control in (
        Control(
            kind=ChangeKind.START,
            log_label=gettext_noop("start"),
            review_label=gettext_noop("Started"),
            allowed_in=frozenset({State.READY}),
            leads_to=State.RUNNING,
            payloads=_ALL_OF_STATE,
            requesters=_PATIENTS_PAGE,
        ),
        Control(
            kind=ChangeKind.PAUSE,
            log_label=gettext_noop("pause"),
            review_label=gettext_noop("Paused"),
            allowed_in=frozenset({State.RUNNING}),
            leads_to=State.PAUSED,
            apply=_pause,
            payloads=_ALL_OF_STATE,
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
            payloads=_ALL_OF_STATE,
            requesters=_PATIENTS_PAGE,
            mark=ChartMark("▸", gettext_noop("went on")),
        ),
        Control(
            kind=ChangeKind.FINISH,
            log_label=gettext_noop("finish"),
            review_label=gettext_noop("Finished"),
            allowed_in=frozenset({State.RUNNING, State.PAUSED}),
            leads_to=State.FINISHED,
            payloads=_ALL_OF_END,
            requesters=_PATIENTS_PAGE,
        ),
        Control(
            kind=ChangeKind.ABORT,
            log_label=gettext_noop("abort"),
            review_label=gettext_noop("Ended early"),
            leads_to=State.ABORTED,
            payloads=_ALL_OF_END,
        ),
        Control(
            kind=ChangeKind.GOAL,
            log_label=gettext_noop("goal"),
            review_label=gettext_noop("Goal"),
            value=ValueKind.NUMBER,
            apply=_set_goal,
            current=lambda session: session.goal,
            payloads={Audience.MONITOR: Payload.VALUE, Audience.SOURCE: Payload.VALUE},
            event_field="goal",
            snapshot_field="goal",
            value_format=ValueFormat.QUANTITY,
            shows_old=True,
            mark=ChartMark("⚑", gettext_noop("goal"), ValueFormat.NUMBER),
            when_locked=_NOTHING,
        ),
        Control(
            kind=ChangeKind.GOAL_ADAPTATION,
            log_label=gettext_noop("automatic goal"),
            review_label=gettext_noop("Automatic goal"),
            value=ValueKind.NAME,
            check=check_adaptation_mode,
            apply=_set_adaptation,
            current=lambda session: session.settings[ChangeKind.GOAL_ADAPTATION],
            initial=lambda plan: plan.adaptation.mode,
            snapshot_field="goal_adaptation",
            value_format=ValueFormat.CHOICE,
            choices=_ADAPTATIONS,
            shows_old=True,
            mark=ChartMark("F", gettext_noop("goal follows"), ValueFormat.CHOICE, _ADAPTATIONS),
            when_locked=_NOTHING,
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
            when_locked=_NOTHING,
        ),
        Control(
            kind=ChangeKind.PHASE,
            log_label=gettext_noop("phase"),
            review_label=gettext_noop("Phase"),
            value=ValueKind.NUMBER,
            apply=_enter_phase,
            current=lambda session: session.phase_index,
            payloads={
                Audience.PATIENT: Payload.PHASE,
                Audience.MONITOR: Payload.PHASE,
                Audience.SOURCE: Payload.PHASE,
                Audience.ROBOT: Payload.CUE,
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
            payloads=_MONITOR_AND_CUE,
            snapshot_field="activation_threshold",
            value_format=ValueFormat.PERCENT,
            shows_old=True,
            mark=ChartMark("A", gettext_noop("robot acts from"), ValueFormat.PERCENT),
            when_locked=_NOTHING,
        ),
        Control(
            kind=ChangeKind.ROBOT_INTENSITY,
            log_label=gettext_noop("robot intensity"),
            review_label=gettext_noop("Robot"),
            value=ValueKind.NUMBER,
            check=check_robot_intensity,
            initial=lambda plan: plan.robot_intensity,
            payloads=_MONITOR_AND_CUE,
            snapshot_field="robot_intensity",
            value_format=ValueFormat.CHOICE,
            choices=_LEVELS,
            shows_old=True,
            mark=ChartMark("R", gettext_noop("robot"), ValueFormat.CHOICE, _LEVELS),
            when_locked=frozenset({0}),  # off, for safety
        ),
        Control(
            kind=ChangeKind.VALENCE,  # of the next phase with feedback
            log_label=gettext_noop("feedback type"),
            review_label=gettext_noop("Next feedback type"),
            value=ValueKind.NAME,
            apply=lambda session, slug: session.schedule_valence(slug),
            current=lambda session: session.valences.next_slug or session.valences.current.slug,
            payloads={Audience.MONITOR: Payload.TYPES},
            value_format=ValueFormat.CHOICE,
            choices=_TYPES,
            mark=ChartMark("N", gettext_noop("next type"), ValueFormat.CHOICE, _TYPES),
            when_locked=_NOTHING,
        ),
        Control(
            kind=ChangeKind.VALENCE_NOW,  # from the next step on; a switch sends more (`course.py`)
            log_label=gettext_noop("feedback type from the next step"),
            review_label=gettext_noop("Feedback type"),
            value=ValueKind.NAME,
            apply=lambda session, slug: session.switch_valence(slug),
            current=lambda session: session.valences.current.slug,
            payloads={Audience.MONITOR: Payload.TYPES},
            value_format=ValueFormat.CHOICE,
            choices=_TYPES,
            when_locked=_NOTHING,
        ),
        Control(
            kind=ChangeKind.FEEDBACK_TEXT,  # for the clinic, or for one session
            log_label=gettext_noop("words"),
            review_label=gettext_noop("Words edited"),
            value=ValueKind.MAPPING,
            apply=lambda session, value: session.valences.edit_text(value),
            payloads={Audience.PATIENT: Payload.LANGUAGE, Audience.MONITOR: Payload.KIND},
            requesters=frozenset(),
            value_format=ValueFormat.CHOICE,
            choices=_TYPES,
            shown_part="valence",
            mark=ChartMark("E", gettext_noop("words edited")),
            when_locked=_NOTHING,
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
            when_locked=_NOTHING,
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
