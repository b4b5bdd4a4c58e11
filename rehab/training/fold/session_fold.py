"""A session as the fold of its log: the same steps and changes always give the same session."""

from __future__ import annotations

from typing import Any

from rehab.training.changes import (
    STATE_LABELS,
    Change,
    ChangeKind,
    NotAllowed,
    PauseReason,
    State,
)
from rehab.training.controls import CONTROLS
from rehab.training.fold.feedback_delivery import FeedbackDelivery
from rehab.training.fold.goal_following import GoalFollowing
from rehab.training.fold.tallies import Block, Tally
from rehab.training.fold.valence_course import ValenceCourse
from rehab.training.goal_adaptation import AdaptationMode
from rehab.training.goals import GoalRule
from rehab.training.heart_rate_limit import is_above_limit, is_near_limit
from rehab.training.measures import InvalidSetting
from rehab.training.plans import ChartStyle, SessionPlan
from rehab.training.scoring import RULES_VERSION, score_measurement
from rehab.training.steps import (
    InvalidMeasurement,
    InvalidReason,
    Measurement,
    ScoredStep,
    Side,
    add_reason,
    find_invalid_reasons,
    select_value,
)
from rehab.training.valences import Valence
from robot.marking import Marked, gettext_noop

# A longer gap between two strides is a break or a jump of the clock: only this much of it counts as
# walked. Recorded strides last 1-2 s, gaps between recorded trials 3.2-5.2 s
# (docs/reference/gait.md#protocol).
MAX_GAP_S = 10.0
ASKS_FOR_GOAL = gettext_noop("The baseline is walked. Go to the next phase to accept its goal.")


class SessionFold:
    """State of a session after the steps and changes of its log so far, in constant memory.

    ``step`` scores a measurement, by the rules of its version, and advances through the phases;
    ``change`` applies what a person decided, effective from the next step. Neither reads a clock.

    Parameters
    ----------
    plan
        What the session is scored with.
    """

    def __init__(self, plan: SessionPlan) -> None:
        self.plan = plan
        self.state = State.READY
        self.last_number = 0
        self.last_time_s: float | None = None
        self.last_times_s: dict[Side, float] = {}  # by leg
        self.active_s = 0.0
        self.goal: float | None = plan.goal.resolve(plan.measure, None)
        self.settings: dict[str, Any] = {
            kind: control.initial(plan)
            for kind, control in CONTROLS.items()
            if control.initial is not None
        }
        self.trained = Tally()  # every step of the trained leg
        self.feedback = Tally()  # those in feedback phases, for score and hit rate
        self.phases = tuple(Tally() for _ in plan.phases)
        self.blocks: dict[Block, Tally] = {}  # the same strides, by phase, gain and type
        self.valences = ValenceCourse(plan)
        self.pause_reason: PauseReason | None = None
        self.rest_s: float | None = None  # planned length of the present rest
        self.is_strained = False  # whether the heart rate is near its limit
        self.was_walking = False  # whether the time since the last step was walked
        self.following = GoalFollowing(plan)
        self.delivery = FeedbackDelivery(plan.schedule)
        self._begin_phase(0)

    @property
    def activation_threshold(self) -> float:
        """Mean performance of a window from which on the robot celebrates."""
        return float(self.settings[ChangeKind.ACTIVATION_THRESHOLD])

    @property
    def robot_intensity(self) -> float:
        """Share of its gestures' size that the robot moves with; 0 for none."""
        return float(self.settings[ChangeKind.ROBOT_INTENSITY])

    @property
    def words_shown(self) -> bool:
        """Whether the patient's page shows words."""
        return bool(self.settings[ChangeKind.WORDS_SHOWN])

    @property
    def chart_style(self) -> ChartStyle:
        """How the patient's page draws the latest strides."""
        style: ChartStyle = self.settings[ChangeKind.CHART_STYLE]
        return style

    @property
    def adaptation_mode(self) -> AdaptationMode:
        """How the goal changes while the patient walks."""
        mode: AdaptationMode = self.settings[ChangeKind.GOAL_ADAPTATION]
        return mode

    @property
    def suggested_goal(self) -> float | None:
        """The goal that the latest strides would have reached as often as wanted; None without."""
        if self.adaptation_mode is AdaptationMode.OFF or not self.phase.adapts:
            return None
        goal = self.following.suggest(self.gain)
        if self.is_strained and goal is not None and self.goal is not None:
            is_higher = goal > self.goal
            return None if is_higher == self.plan.measure.higher_is_better else goal
        return goal

    @property
    def score(self) -> int | None:
        """Points of the session, of all its valences; None where none of them had points."""
        return self.feedback.points if self.valences.have_points else None

    def tally_of(self, kind: str) -> Tally:
        """Return the sums over all phases of one kind."""
        total = Tally()
        for phase, tally in zip(self.plan.phases, self.phases, strict=True):
            if phase.kind == kind:
                total.merge(tally)
        return total

    @property
    def baseline_mean(self) -> float | None:
        """Mean of the valid baseline values; None before there are enough of them."""
        baseline = self.tally_of("baseline")
        is_enough = baseline.valid >= self.plan.goal.baseline_strides
        return baseline.mean_value if is_enough else None

    def step(self, measurement: Measurement) -> ScoredStep:
        """Score one stride and count it.

        Raises
        ------
        NotAllowed
            Where the session has not begun or is over.
        InvalidMeasurement
            For a number that does not follow the last one.
        """
        running = self.state is State.RUNNING
        if not running and self.state is not State.PAUSED:
            raise NotAllowed(
                "A session that is {state} takes no steps; it must be running.",
                state=Marked(STATE_LABELS[self.state]),
            )
        if measurement.number != self.last_number + 1:
            raise InvalidMeasurement(
                f"Step {measurement.number} does not follow step {self.last_number}; "
                f"send {self.last_number + 1}."
            )
        version = measurement.rules_version or RULES_VERSION
        time_s, side = measurement.time_s, measurement.side
        before_s = self.last_time_s if version == 1 else self.last_times_s.get(side)
        backwards = before_s is not None and time_s < before_s
        elapsed_s = 0.0 if self.last_time_s is None else time_s - self.last_time_s
        measurement = select_value(measurement, self.plan.measure)
        reasons = find_invalid_reasons(measurement, self.plan.measure)
        if backwards:
            reasons = add_reason(reasons, InvalidReason.TIME_BACKWARDS)
        if not running:
            reasons = add_reason(reasons, InvalidReason.PAUSED)
        scored = score_measurement(
            measurement,
            reasons,
            measure=self.plan.measure,
            trained_side=self.plan.trained_side,
            phase=self.phase_index,
            gain=self.gain,
            goal=self.goal,
            valence=self.valences.current if self.phase.feedback else None,
            close_steps=self.plan.close_steps,
            rules_version=version,
        )
        self.last_number = scored.number
        self.following.moved, self.delivery.answer = False, None
        if scored.side == self.plan.trained_side:
            self._count(scored, running)
        if self.was_walking and not backwards:
            walked_s = min(max(elapsed_s, 0.0), MAX_GAP_S)
            self.active_s += walked_s
            self.phase_s += walked_s
        # Later steps follow a clock that was set back (a source that began anew): one step is lost.
        # A leg may end its stride a little before the other one, whose stride came first.
        is_overtaken = elapsed_s < 0 and not backwards
        self.last_time_s = self.last_time_s if is_overtaken else time_s
        self.last_times_s[side] = time_s
        self.was_walking = running and not backwards
        if running and self.phase.is_over(self.phase_strides, self.phase_s):
            self._advance_phase()
        limit = self.plan.heart_rate_limit
        self.is_strained = is_near_limit(scored, limit, self.is_strained)
        if self.state is State.RUNNING and is_above_limit(scored, limit):
            self.state = State.PAUSED
            self.pause(PauseReason.HEART_RATE)
        return scored

    def _count(self, step: ScoredStep, running: bool) -> None:
        self.trained.add(step)
        if running:
            self.phases[self.phase_index].add(step)
            valence = self.valences.current.slug if self.phase.feedback else ""
            block = Block(self.phase_index, self.gain, valence)
            if (tally := self.blocks.get(block)) is None:
                tally = self.blocks[block] = Tally()
            tally.add(step)
            if self.phase.feedback:
                self.feedback.add(step)
                self.delivery.add(step, self.feedback.judged)
            if self.phase.adapts and step.valid and step.value is not None:
                self.following.latest.append(step.value)
                if self.adaptation_mode is AdaptationMode.AUTOMATIC:
                    goal = self.following.move(step)
                    self.goal = self.goal if goal is None else goal
            self.phase_strides += 1

    def _advance_phase(self) -> None:
        """Begin the next phase, or note why that cannot be."""
        if self.phase_index + 1 == len(self.plan.phases):
            self.completed = True
            return
        ended = self.phase
        if self.plan.goal.asks and self.goal is None and ended.kind == "baseline":
            self.obstacle = ASKS_FOR_GOAL
            return
        try:
            self.enter_phase(self.phase_index + 1)
        except InvalidSetting as problem:
            self.obstacle = str(problem)
            return
        if ended.rest_s is not None:
            self.state, self.rest_s = State.PAUSED, ended.rest_s
            self.pause(PauseReason.REST)

    def enter_phase(self, index: int) -> None:
        """Begin a phase. Raises InvalidSetting where its goal should be known and cannot be."""
        kinds = [phase.kind for phase in self.plan.phases]
        percent = self.plan.phases[index].goal_percent
        if percent is not None:
            self.goal = self._goal_from_baseline(GoalRule(percent_of_baseline=percent))
        elif self.goal is None and kinds[index] != "baseline" and "baseline" in kinds[:index]:
            self.goal = self._goal_from_baseline(self.plan.goal)
        self._begin_phase(index)

    def _begin_phase(self, index: int) -> None:
        self.phase_index = index
        self.phase = self.plan.phases[index]  # the one that the next step falls in
        self.phase_strides, self.phase_s = 0, 0.0
        self.gain = self.phase.gain
        self.obstacle = ""  # why the plan cannot go on, in words for the PT
        self.completed = False  # the last phase has reached its limit
        if self.phase.feedback:
            self.valences.begin_phase(self.last_number)

    def _goal_from_baseline(self, rule: GoalRule) -> float | None:
        if self.baseline_mean is None:
            raise NotAllowed(
                "The goal needs {needed} valid baseline strides and has {had}. Walk on, or set the "
                "goal as a value.",
                needed=self.plan.goal.baseline_strides,
                had=self.tally_of("baseline").valid,
            )
        return rule.resolve(self.plan.measure, self.baseline_mean)

    def change(self, change: Change) -> None:
        """Apply a change from the next step on.

        Raises
        ------
        NotAllowed
            Where the state does not allow it; the session is then as it was.
        InvalidSetting
            For a value out of bounds; likewise.
        """
        control = CONTROLS[change.kind]
        state = control.next_state(self.state)
        control.put_into_force(self, change.value)
        self.state = state

    def pause(self, reason: PauseReason | None) -> None:
        """Note that the time from here on is not walked, and why; None where it is unknown."""
        self.was_walking, self.pause_reason = False, reason

    def resume(self) -> None:
        """Clear why the session was paused."""
        self.pause_reason = self.rest_s = None

    @property
    def valence(self) -> Valence:
        """The valence that is in force."""
        return self.valences.current

    def schedule_valence(self, slug: object) -> None:
        """Schedule the valence of the next phase with feedback; the current one cancels that."""
        later = self.plan.phases[self.phase_index + 1 :]
        self.valences.schedule(slug, is_possible=any(phase.feedback for phase in later))

    def switch_valence(self, slug: object) -> None:
        """Change the valence from the next step on, which cancels a scheduled one."""
        self.valences.switch(slug, self.last_number)
