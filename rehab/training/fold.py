"""A session as the fold of its log: the same steps and changes always give the same session."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import replace
from typing import NamedTuple

from rehab.training.changes import (
    KIND_WORDS,
    STATE_WORDS,
    Change,
    ChangeKind,
    PauseReason,
    Refused,
    State,
    next_state,
)
from rehab.training.goals import MIN_BASELINE_STRIDES
from rehab.training.marking import Marked
from rehab.training.measures import InvalidSetting, check_gain
from rehab.training.plans import (
    ChartStyle,
    SessionPlan,
    check_activation_threshold,
    check_robot_intensity,
)
from rehab.training.scoring import RULES_VERSION, judge
from rehab.training.steps import (
    InvalidMeasurement,
    Measurement,
    Reason,
    ScoredStep,
    add_reason,
    find_reasons,
)
from rehab.training.tallies import Tally
from rehab.training.valences import Valence, bands_from_json

# Strides further apart than this were not walked without a break, or a clock jumped: no more than
# so much counts as walked. Recorded strides last 1-2 s, gaps between recorded trials 3.2-5.2 s
# (docs/reference/gait.md#protocol).
MAX_GAP_S = 10.0


class Block(NamedTuple):
    """What was alike while some strides of a phase were walked; no valence without feedback."""

    phase: int
    gain: float
    valence: str


class SessionFold:
    """Where a session stands after the steps and changes it was given, in constant memory.

    ``step`` scores a measurement and moves on through the phases; ``change`` applies what a person
    decided, effective from the next step. Neither looks at a clock.
    """

    def __init__(self, plan: SessionPlan) -> None:
        self.plan = plan
        self.state = State.READY
        self.last_number = 0
        self.last_time_s: float | None = None
        self.active_s = 0.0
        self.goal: float | None = plan.goal.resolve(plan.measure, None)
        self.activation_threshold = plan.activation_threshold
        self.robot_intensity = plan.robot_intensity
        self.trained = Tally()  # every step of the trained leg
        self.feedback = Tally()  # those in feedback phases: what score and hit rate count
        self.phases = tuple(Tally() for _ in plan.phases)
        self.blocks: dict[Block, Tally] = {}  # the same strides, apart where gain or type changed
        # What may be in force, as it is worded now; which is, and which will be with the next
        # feedback; after which step it changed to which.
        self.valences = {one.slug: one for one in (plan.valence, *plan.alternatives)}
        self.valence: Valence = plan.valence
        self.next_valence = ""
        self.switches: list[tuple[int, str]] = []
        self.words_shown = True
        self.chart_style = ChartStyle.POINTS
        self.pause_reason: PauseReason | None = None
        self._joined = False  # whether the time since the last step was walked
        self._begin(0)

    @classmethod
    def replay(cls, plan: SessionPlan, log: Iterable[Measurement | Change]) -> SessionFold:
        """Give the fold of a whole log."""
        fold = cls(plan)
        for entry in log:
            if isinstance(entry, Change):
                fold.change(entry)
            else:
                fold.step(entry)
        return fold

    @property
    def score(self) -> int | None:
        """Points of the session, of all its valences; None where none of them had points."""
        walked = (self.plan.valence.slug, *self.changed_to)
        paid = any(self.valences[slug].has_points for slug in walked)
        return self.feedback.points if paid else None

    @property
    def changed_to(self) -> tuple[str, ...]:
        """The valences that it was changed to on its way, in their order, each once."""
        others = dict.fromkeys(slug for _, slug in self.switches)
        others.pop(self.plan.valence.slug, None)
        return tuple(others)

    def tally_of(self, kind: str) -> Tally:
        """Give the sums over all phases of one kind."""
        total = Tally()
        for phase, tally in zip(self.plan.phases, self.phases, strict=True):
            if phase.kind == kind:
                total.merge(tally)
        return total

    @property
    def baseline_mean(self) -> float | None:
        """Mean of the valid baseline values; None before there are enough of them."""
        baseline = self.tally_of("baseline")
        return baseline.mean_value if baseline.valid >= MIN_BASELINE_STRIDES else None

    def step(self, measurement: Measurement) -> ScoredStep:
        """Score one stride. Raises Refused where the session has not begun or is over.

        Raises InvalidMeasurement for a number that is not the next one.
        """
        running = self.state is State.RUNNING
        if not running and self.state is not State.PAUSED:
            raise Refused(
                "A session that is {state} takes no steps; it must be running.",
                state=Marked(STATE_WORDS[self.state]),
            )
        if measurement.number != self.last_number + 1:
            raise InvalidMeasurement(
                f"Step {measurement.number} does not follow step {self.last_number}; "
                f"send {self.last_number + 1}."
            )
        time_s = measurement.time_s
        elapsed_s = 0.0 if self.last_time_s is None else time_s - self.last_time_s
        backwards = elapsed_s < 0
        reasons = find_reasons(measurement, self.plan.measure)
        if backwards:
            reasons = add_reason(reasons, Reason.TIME_BACKWARDS)
        if not running:
            reasons = add_reason(reasons, Reason.PAUSED)
        scored = self._score(measurement, reasons)
        self.last_number = scored.number
        if scored.side == self.plan.trained_side:
            self._count(scored, running)
        if self._joined and not backwards:
            walked_s = min(elapsed_s, MAX_GAP_S)
            self.active_s += walked_s
            self.phase_s += walked_s
        # Later steps follow a clock that was set back (a source that began anew): one step is lost.
        self.last_time_s = time_s
        self._joined = running and not backwards
        if running and self.phase.is_over(self.phase_strides, self.phase_s):
            self._move_on()
        return scored

    def _score(self, measurement: Measurement, reasons: tuple[str, ...]) -> ScoredStep:
        plan, goal, value = self.plan, self.goal, measurement.value
        shown = performance = hit = points = None
        if reasons:
            if value is not None and not math.isfinite(value):
                value = None
        elif value is not None and goal is not None and measurement.side == plan.trained_side:
            shown, performance, hit = judge(plan.measure, value, self.gain, goal)
            if self.phase.feedback:
                points = self.valence.points(hit)
        return ScoredStep(
            number=measurement.number,
            time_s=measurement.time_s,
            side=measurement.side,
            value=value,
            gain=self.gain,
            shown=shown,
            goal=goal,
            performance=performance,
            hit=hit,
            points=points,
            valid=not reasons,
            reasons=reasons,
            phase=self.phase_index,
            extra=measurement.extra,
            rules_version=RULES_VERSION,
        )

    def _count(self, step: ScoredStep, running: bool) -> None:
        self.trained.add(step)
        if running:
            self.phases[self.phase_index].add(step)
            valence = self.valence.slug if self.phase.feedback else ""
            block = Block(self.phase_index, self.gain, valence)
            self.blocks.setdefault(block, Tally()).add(step)
            if self.phase.feedback:
                self.feedback.add(step)
            self.phase_strides += 1

    def _move_on(self) -> None:
        """Go to the next phase, or note why that cannot be."""
        if self.phase_index + 1 == len(self.plan.phases):
            self.completed = True
            return
        try:
            self._enter(self.phase_index + 1)
        except InvalidSetting as problem:
            self.obstacle = str(problem)

    def _enter(self, index: int) -> None:
        """Begin a phase. Raises InvalidSetting where its goal should be known and cannot be."""
        kinds = [phase.kind for phase in self.plan.phases]
        if self.goal is None and kinds[index] != "baseline" and "baseline" in kinds[:index]:
            self.goal = self._goal_from_baseline()
        self._begin(index)

    def _begin(self, index: int) -> None:
        self.phase_index = index
        self.phase = self.plan.phases[index]  # the one that the next step falls in
        self.phase_strides = 0
        self.phase_s = 0.0
        self.gain = self.phase.gain
        self.obstacle = ""  # why the plan cannot go on, in words for the PT
        self.completed = False  # the last phase has reached its limit
        if self.next_valence and self.phase.feedback:
            self.valence = self.valences[self.next_valence]
            self.next_valence = ""
            self.switches.append((self.last_number, self.valence.slug))

    def _goal_from_baseline(self) -> float | None:
        if self.baseline_mean is None:
            raise Refused(
                "The goal needs {needed} valid baseline strides and has {had}. Walk on, or set the "
                "goal as a value.",
                needed=MIN_BASELINE_STRIDES,
                had=self.tally_of("baseline").valid,
            )
        return self.plan.goal.resolve(self.plan.measure, self.baseline_mean)

    def change(self, change: Change) -> None:
        """Apply a change from the next step on.

        Raises Refused where the state does not allow it and InvalidSetting for a value out of
        bounds; the session is then as it was.
        """
        state = next_state(self.state, change.kind)
        match change.kind:
            case ChangeKind.GOAL:
                self.goal = self.plan.measure.check_goal(_needed(change))
                self.obstacle = ""
            case ChangeKind.GAIN:
                self.gain = check_gain(_needed(change))
            case ChangeKind.ACTIVATION_THRESHOLD:
                self.activation_threshold = check_activation_threshold(_needed(change))
            case ChangeKind.ROBOT_INTENSITY:
                self.robot_intensity = check_robot_intensity(_needed(change))
            case ChangeKind.PHASE:
                self._enter(self._phase_index(_needed(change)))
            case ChangeKind.PAUSE:
                self._joined = False
                known = [reason for reason in PauseReason if reason == change.value]
                self.pause_reason = known[0] if known else None
            case ChangeKind.RESUME:
                self.pause_reason = None
            case ChangeKind.VALENCE:
                self._plan_valence(change.value)
            case ChangeKind.WORDS:
                self._reword(change.value)
            case ChangeKind.WORDS_SHOWN:
                self.words_shown = _switch(_needed(change))
            case ChangeKind.CHART_STYLE:
                self.chart_style = _style(change.value)
        self.state = state

    def _plan_valence(self, slug: object) -> None:
        """Note the valence of the next phase with feedback; the one in force undoes that."""
        if not isinstance(slug, str) or slug not in self.valences:
            known = ", ".join(self.valences)
            raise InvalidSetting(
                "The feedback type of this session can be changed to one of: {known}.",
                known=known,
            )
        if slug == self.valence.slug:
            self.next_valence = ""
        elif any(phase.feedback for phase in self.plan.phases[self.phase_index + 1 :]):
            self.next_valence = slug
        else:
            raise Refused(
                "The feedback type changes with a phase, and no phase with feedback follows. "
                "End this session and set up another one."
            )

    def _reword(self, value: object) -> None:
        """Take other bands for a valence. What a step earns stays as it was planned."""
        given = value if isinstance(value, Mapping) else {}
        slug = given.get("valence")
        if not isinstance(slug, str) or slug not in self.valences:
            raise InvalidSetting("Words are given with their valence, one of the session's.")
        worded = replace(self.valences[slug], bands=bands_from_json(given.get("bands")))
        self.valences[slug] = worded
        if self.valence.slug == slug:
            self.valence = worded

    def _phase_index(self, value: float) -> int:
        if not 0 <= value < len(self.plan.phases) or value != int(value):
            raise InvalidSetting(
                "This session has no phase {value:g}; its phases are numbered 0 to {last}.",
                value=value,
                last=len(self.plan.phases) - 1,
            )
        return int(value)


def _needed(change: Change) -> float:
    value: object = change.value  # JSON knows true and false beside numbers
    if isinstance(value, bool) or not isinstance(value, int | float):
        raise InvalidSetting(
            "The change '{kind}' needs a value, and that is a number.",
            kind=Marked(KIND_WORDS[change.kind]),
        )
    return value


def _switch(value: float) -> bool:
    if value not in (0, 1):
        raise InvalidSetting("Words are shown (1) or not (0).")
    return value == 1


def _style(value: object) -> ChartStyle:
    try:
        return ChartStyle(value)  # type: ignore[arg-type]  # whatever it is, it is looked up
    except ValueError:
        raise InvalidSetting(
            "A chart's style is one of: {known}.", known=", ".join(ChartStyle)
        ) from None
