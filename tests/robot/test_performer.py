"""What a robot does with what it hears: it answers windows, and moves only while all allows it."""

import math
from dataclasses import replace
from typing import ClassVar

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from robot.bases import Abilities, Mood, Senses
from robot.bases.kinematic import KinematicBase
from robot.behavior.performer import SILENCE_S, Performer
from robot.motion.gesture_spec import Move, to_data
from robot.motion.gestures import GESTURES, ORIGINALS
from robot.motion.limits import DEFAULT_LIMITS, TICK_S
from robot.motion.pose import HOME
from robot.motion.twist import STILL, Twist
from robot.simulation import Rehearsal

CUE = {
    "above": "celebrate",
    "below": "droop",
    "threshold": 0.9,
    "window_s": 5,
    "rest_s": 5,
    "intensity": 1,
}
WELCOME = {"type": "welcome", "session": 7, "state": "running", "cue": CUE, "stopped": False}
WELCOME |= {"watched": True}


class RealBase(KinematicBase):
    """A base that no program may arm."""

    name: ClassVar[str] = "real"
    abilities = Abilities(simulated=False, moves=True)


class Stage:
    """A performer with a clock, and everything that came of it."""

    def __init__(self, make=KinematicBase):
        self.now_s = 1000.0
        self.base = make(lambda: self.now_s)
        self.robot = Performer(self.base)
        self.reports = []
        self.source_s = 0.0
        self.heartbeats = True

    def hear(self, **message):
        self.robot.hear(message, self.now_s)
        self.collect()

    def collect(self):
        while self.robot.reports:
            self.reports.append((round(self.now_s, 3), self.robot.reports.popleft()))

    def wait(self, span_s):
        for _ in range(round(span_s / TICK_S)):
            self.now_s += TICK_S
            if self.heartbeats:
                self.hear(type="heartbeat")
            self.robot.tick(self.now_s)
            self.collect()

    def walk(self, *performances, every_s=1.0):
        for performance in performances:
            self.hear(type="step", time_s=self.source_s, performance=performance)
            self.wait(every_s)
            self.source_s += every_s

    def of(self, kind):
        return [report for _, report in self.reports if report["kind"] == kind]

    @property
    def state(self):
        return self.of("status")[-1]["state"], self.of("status")[-1]["reason"]

    @property
    def ended(self):
        return [r["outcome"] for r in self.of("gesture") if r["phase"] == "ended"]

    def perform(self):
        """Walk until a gesture has begun and moves."""
        self.walk(1.0, 1.0, 1.0, 1.0, 1.0)
        self.hear(type="step", time_s=self.source_s, performance=1.0)
        self.wait(0.5)
        self.source_s += 0.5
        assert self.robot.player.is_busy
        assert not self.base.read().twist.is_still
        return self


@pytest.fixture
def stage():
    stage = Stage()
    stage.hear(**WELCOME)
    return stage


def test_a_strong_window_is_celebrated_and_told(stage):
    stage.perform().wait(4)
    (decision,) = stage.of("decision")
    assert decision == {
        "kind": "decision",
        "from_s": 0.0,
        "until_s": 5.0,
        "steps": 5,
        "mean": 1.0,
        "threshold": 0.9,
        "above": True,
        "gesture": "celebrate",
        "intensity": 0.75,
        "reason": "",
        "activated_share": 1.0,
    }
    assert stage.of("gesture") == [
        {"kind": "gesture", "name": "celebrate", "phase": "started", "outcome": ""},
        {"kind": "gesture", "name": "celebrate", "phase": "ended", "outcome": "done"},
    ]
    assert stage.state == ("idle", "")
    pose = stage.base.read().pose
    assert pose.distance_m(HOME) < 0.01


def test_a_weak_window_droops(stage):
    stage.walk(*[0.5] * 6)
    assert stage.of("decision")[0]["gesture"] == "droop"
    assert stage.of("decision")[0]["above"] is False


def test_status_comes_every_second_and_four_times_while_it_moves(stage):
    stage.wait(10)
    assert 10 <= len(stage.of("status")) <= 12
    idle = len(stage.reports)
    stage.perform()
    stage.wait(2.5)
    moving = [r for t, r in stage.reports[idle:] if r.get("state") == "performing"]
    assert 11 <= len(moving) <= 13
    assert len({report["pose"]["x_m"] for report in moving}) > 5
    assert {report["gesture"] for report in moving} == {"celebrate"}


@pytest.mark.parametrize("state", ["paused", "finished", "aborted"])
def test_a_session_that_does_not_run_eases_the_robot_to_a_stop(stage, state):
    stage.perform()
    stage.hear(type="state", state=state)
    assert stage.robot.player.is_busy  # it slows down, it does not jerk
    stage.wait(0.5)
    assert stage.base.read().twist == STILL
    assert stage.ended == [state]
    stage.walk(*[1.0] * 12)
    assert len(stage.of("decision")) == 1
    assert stage.state == ("idle", "not_running")


def test_steps_before_a_pause_are_not_made_up_for(stage):
    stage.walk(1.0, 1.0, 1.0, 1.0)
    stage.hear(type="state", state="paused")
    stage.wait(3)
    stage.hear(type="state", state="running")
    stage.source_s = 60.0
    stage.walk(0.5, 0.5)
    assert not stage.of("decision")


def test_silence_halts_it_within_three_quarters_of_a_second(stage):
    stage.perform()
    stage.heartbeats = False
    silent_s = stage.now_s
    while stage.robot.player.is_busy:
        stage.wait(TICK_S)
    assert stage.now_s - silent_s <= SILENCE_S + 2 * TICK_S <= 0.75
    assert stage.base.read().twist == STILL
    assert stage.ended == ["no_link"]
    stage.heartbeats = True
    stage.walk(*[1.0] * 12)  # of the old connection: it counts no more
    assert len(stage.of("decision")) == 1
    stage.hear(**WELCOME)
    stage.walk(*[1.0] * 12)
    assert len(stage.of("decision")) == 3


def test_a_lost_link_halts_it_at_once(stage):
    stage.perform()
    stage.robot.lose("no_link")
    assert stage.base.read().twist == STILL
    before = len(stage.of("status"))
    stage.wait(3)
    assert stage.ended == ["no_link"]
    assert len(stage.of("status")) == before  # there is nobody to tell


def test_a_stop_is_immediate_and_holds_until_someone_arms_it(stage):
    stage.perform()
    stage.hear(type="stop")
    assert stage.base.read().twist == STILL
    assert stage.ended == ["stopped"]
    stage.hear(type="stop")
    stage.walk(*[1.0] * 12)
    assert stage.state == ("stopped", "stopped")
    stage.robot.lose("no_link")
    stage.hear(**WELCOME)
    stage.walk(*[1.0] * 12)
    assert {decision["reason"] for decision in stage.of("decision")[1:]} == {"stopped"}
    stage.hear(type="arm")
    stage.walk(*[1.0] * 7)
    assert stage.of("decision")[-1]["gesture"] == "celebrate"


def test_a_stop_counts_before_any_welcome():
    stage = Stage()
    stage.hear(type="stop")
    stage.hear(**WELCOME)
    stage.walk(*[1.0] * 6)
    assert stage.of("decision")[0]["reason"] == "stopped"


def test_a_stop_that_was_missed_is_in_the_welcome(stage):
    stage.perform()
    stage.hear(**WELCOME | {"stopped": True})
    assert stage.base.read().twist == STILL
    stage.wait(1)
    assert stage.state == ("stopped", "stopped")


def test_only_a_person_arms_a_real_base():
    stage = Stage(RealBase)
    stage.hear(**WELCOME)
    stage.walk(*[1.0] * 7)
    assert stage.state == ("disarmed", "disarmed")
    assert stage.of("decision")[0]["reason"] == "disarmed"
    stage.hear(type="arm")
    stage.walk(*[1.0] * 5)
    assert stage.of("decision")[-1]["gesture"] == "celebrate"
    stage.robot.lose("no_link")
    stage.hear(**WELCOME)
    stage.walk(*[1.0] * 7)
    assert stage.of("decision")[-1]["reason"] == "disarmed"


def test_a_real_base_away_from_home_waits_for_a_person_to_put_it_back():
    stage = Stage(RealBase)
    stage.hear(**WELCOME)
    stage.hear(type="arm")
    stage.perform()
    stage.hear(type="state", state="paused")
    stage.wait(1)
    for _ in range(50):  # pushed
        stage.base.drive(Twist(0.1, 0))
        stage.now_s += TICK_S
    stage.hear(type="state", state="running")
    stage.walk(*[1.0] * 8)
    assert stage.of("decision")[-1]["reason"] == "away_from_home"
    stage.hear(type="arm")
    stage.walk(*[1.0] * 5)
    assert stage.of("decision")[-1]["gesture"] == "celebrate"


def test_a_simulated_base_is_carried_home(stage):
    stage.perform()
    stage.wait(1)
    stage.hear(type="state", state="paused")
    stage.wait(1)
    assert stage.base.read().pose.distance_m(HOME) > 0.05
    stage.hear(type="state", state="running")
    stage.walk(*[1.0] * 6, every_s=1.2)
    assert stage.of("decision")[-1]["gesture"] == "celebrate"


def test_another_session_begins_with_a_share_of_its_own(stage):
    stage.walk(*[0.5] * 11)
    assert stage.of("decision")[-1]["activated_share"] == 0
    stage.hear(**WELCOME | {"session": 8})
    stage.walk(*[1.0] * 11)
    assert stage.of("decision")[-1]["activated_share"] == 1


def test_no_session_no_gesture(stage):
    stage.perform()
    stage.hear(type="welcome", session=None)
    stage.wait(1)
    assert stage.ended == ["replaced"]
    assert stage.state == ("idle", "no_session")


def farthest_m(stage):
    return max(report["pose"]["x_m"] for report in stage.of("status"))


@pytest.mark.parametrize(
    ("intensity", "performance", "away_m"),
    [(1, 1.2, 0.07), (1, 1.0, 0.0525), (1, 0.9, 0.035), (0.5, 1.2, 0.035), (0.5, 0.9, 0.0175)],
)
def test_a_celebration_is_as_large_as_order_and_walk_ask_for(stage, intensity, performance, away_m):
    stage.hear(type="cue", cue=CUE | {"intensity": intensity})
    stage.walk(*[performance] * 6)
    stage.wait(5)
    assert stage.of("decision")[0]["intensity"] == pytest.approx(away_m / 0.07, abs=1e-3)
    assert farthest_m(stage) == pytest.approx(away_m, abs=0.006)
    assert stage.ended == ["done"]


def test_weak_walking_never_makes_a_droop_grow(stage):
    stage.walk(*[0.1] * 6)
    assert stage.of("decision")[0]["intensity"] == 1


@pytest.mark.parametrize("name", ORIGINALS)
@pytest.mark.parametrize("intensity", [1, 0.5])
def test_the_paper_s_gestures_are_the_same_every_time(stage, name, intensity):
    stage.hear(type="cue", cue=CUE | {"above": name, "intensity": intensity})
    stage.walk(*[0.9] * 6)
    assert stage.of("decision")[0]["intensity"] == intensity
    stage.wait(40)
    assert stage.ended == ["done"]
    assert stage.base.read().pose.distance_m(HOME) < 0.01


def test_a_quiet_robot_goes_half_as_far_at_half_the_speed_in_the_same_time():
    def look(intensity):
        stage = Stage()
        stage.hear(**WELCOME | {"cue": CUE | {"intensity": intensity}})
        stage.walk(*[1.2] * 5)
        stage.hear(type="step", time_s=stage.source_s, performance=1.2)
        speeds = []
        while stage.robot.player.is_busy:
            stage.wait(TICK_S)
            speeds.append(abs(stage.base.read().twist.v_m_s))
        return max(speeds), len(speeds) * TICK_S

    (loud_m_s, loud_s), (quiet_m_s, quiet_s) = look(1), look(0.5)
    assert quiet_m_s == pytest.approx(loud_m_s / 2, rel=0.15)
    assert quiet_s == pytest.approx(loud_s, rel=0.15)


def test_a_robot_that_is_off_decides_and_stands_still(stage):
    stage.perform()
    stage.hear(type="cue", cue=CUE | {"intensity": 0})
    assert stage.robot.player.is_busy  # what has begun comes home
    stage.walk(*[1.0] * 12)
    assert stage.ended == ["done"]
    last = stage.of("decision")[-1]
    assert (last["gesture"], last["intensity"], last["reason"]) == (None, None, "off")
    assert last["activated_share"] == 1


# --- gestures that come along with the cue --------------------------------------------------------

WAVE = to_data("wave", [Move(turn_rad=0.6), Move(turn_rad=-1.2), Move(turn_rad=0.6)])
FAR = to_data("far", [Move(forward_m=0.4), Move(forward_m=-0.4)])


def test_a_composed_gesture_needs_no_new_robot(stage):
    stage.hear(type="cue", cue=CUE | {"above": "wave", "gestures": [WAVE]})
    stage.walk(*[1.1] * 6)
    stage.wait(5)
    assert stage.of("decision")[0]["gesture"] == "wave"
    assert [report["name"] for report in stage.of("gesture")] == ["wave", "wave"]
    assert stage.ended == ["done"]
    assert stage.base.read().pose.distance_m(HOME) < 0.01
    stage.hear(type="cue", cue=CUE | {"above": "wave"})  # it goes with its cue
    stage.walk(*[1.1] * 6)
    assert stage.of("decision")[-1]["reason"] == "unknown_gesture"


@pytest.mark.parametrize(
    ("data", "words"),
    [
        (FAR, "goes 0.40 m away"),
        (FAR | {"steps": 3}, "list of steps"),
        (WAVE | {"steps": [{"turn_rad": math.nan}]}, "not finite"),
        (WAVE | {"steps": [{"turn_rad": 1.0}]}, "It ends turned by 57°"),
    ],
)
@pytest.mark.parametrize("make", [KinematicBase, RealBase])
def test_a_gesture_that_does_not_validate_here_moves_nothing(make, data, words):
    stage = Stage(make)
    name = data["name"]
    stage.hear(**WELCOME | {"cue": CUE | {"above": name, "gestures": [data]}})
    stage.hear(type="arm")
    stage.walk(*[1.2] * 6)
    decision = stage.of("decision")[0]
    assert (decision["gesture"], decision["reason"]) == (None, "bad_gesture")
    assert words in stage.robot.last_bad
    assert stage.robot.bad_messages == 1
    assert stage.base.read().pose == HOME
    assert stage.of("gesture") == []


@pytest.mark.parametrize("broken", [FAR, WAVE, {"steps": 3}])
def test_what_comes_under_a_built_in_name_does_not_take_the_gesture_away(stage, broken):
    stage.hear(type="cue", cue=CUE | {"gestures": [broken | {"name": "celebrate"}]})
    stage.walk(*[1.2] * 6)
    decision = stage.of("decision")[0]
    assert (decision["gesture"], decision["reason"]) == ("celebrate", "")
    assert "celebrate" in stage.robot.last_bad


def test_a_robot_s_own_gesture_is_not_replaced(stage):
    stage.robot.repertoire.own = GESTURES | {"wave": GESTURES["nod"]}
    stage.hear(type="cue", cue=CUE | {"above": "wave", "gestures": [WAVE]})
    stage.walk(*[1.2] * 6)
    assert stage.of("decision")[0]["reason"] == "bad_gesture"


def test_a_slower_robot_refuses_what_it_cannot_reach_in_time(stage):
    slow = Stage(KinematicBase)
    slow.robot = Performer(slow.base, DEFAULT_LIMITS.scaled(0.1))
    slow.hear(**WELCOME | {"cue": CUE | {"above": "wave", "gestures": [WAVE]}})
    slow.walk(*[1.2] * 6)
    assert slow.of("decision")[0]["reason"] == "bad_gesture"
    assert "out_of_time" in slow.robot.last_bad


@settings(deadline=None)  # each walks six seconds
@given(st.lists(st.none() | st.integers() | st.text() | st.just({"name": [1]}), max_size=8))
def test_no_gesture_of_a_cue_can_crash_it(gestures):
    stage = Stage()
    stage.hear(**WELCOME | {"cue": CUE | {"above": "wave", "gestures": gestures}})
    stage.walk(*[1.2] * 6)
    assert stage.of("decision")[0]["reason"] == "unknown_gesture"


def test_gestures_are_a_short_list(stage):
    stage.hear(type="cue", cue=CUE | {"intensity": 0.3, "gestures": [WAVE] * 9})
    stage.hear(type="cue", cue=CUE | {"intensity": 0.3, "gestures": "wave"})
    assert stage.robot.bad_messages == 2
    assert stage.robot.activation.cue.intensity == 1


def test_a_gesture_that_nobody_knows(stage):
    stage.hear(type="cue", cue=CUE | {"above": "somersault"})
    stage.walk(*[1.0] * 6)
    assert stage.of("decision")[0]["reason"] == "unknown_gesture"
    assert stage.of("decision")[0]["gesture"] is None


# --- safety: what the base feels, who looks on, how it is announced -------------------------------


class FeelingBase(RealBase):
    """A real base that feels what a test tells it to, and has lights and sounds."""

    abilities = Abilities(simulated=False, moves=True, announces=True)

    def __init__(self, monotonic):
        super().__init__(monotonic)
        self.senses, self.shown, self.is_held = Senses(), [], False

    def read(self):
        there = super().read()
        if self.is_held:
            there = replace(there, pose=HOME, twist=STILL)
        return replace(there, senses=self.senses)

    def show(self, mood, *, aloud):
        self.shown.append((mood, aloud))


@pytest.fixture
def felt():
    stage = Stage(FeelingBase)
    stage.hear(**WELCOME)
    stage.hear(type="arm")
    return stage


def test_a_gesture_is_announced_half_a_second_before_it_moves(felt):
    felt.walk(*[1.0] * 5)
    felt.hear(type="step", time_s=5.0, performance=1.0)
    begun_s = felt.now_s
    felt.wait(TICK_S)
    assert felt.base.shown[-1] == (Mood.MOVING, True)
    assert felt.robot.player.is_busy
    while felt.base.read().twist.is_still:
        felt.wait(TICK_S)
    assert 0.5 <= felt.now_s - begun_s <= 0.5 + 3 * TICK_S
    felt.wait(5)
    assert felt.ended == ["done"]
    assert felt.base.shown[-1] == (Mood.READY, False)


@pytest.mark.parametrize("deed", [{"type": "stop"}, {"type": "state", "state": "paused"}])
def test_what_is_announced_can_still_be_called_off(felt, deed):
    felt.walk(*[1.0] * 5)
    felt.hear(type="step", time_s=5.0, performance=1.0)
    felt.wait(0.3)
    felt.hear(**deed)
    felt.wait(2)
    assert felt.base.read().pose == HOME
    assert len(felt.ended) == 1


def test_quiet_gestures_make_no_sound(felt):
    felt.hear(type="cue", cue=CUE | {"intensity": 0.5})
    felt.walk(*[1.0] * 6)
    felt.hear(type="stop")
    felt.wait(0.1)
    assert {mood for mood, _ in felt.base.shown} >= {Mood.MOVING, Mood.STOPPED}
    assert not any(aloud for _, aloud in felt.base.shown)


def test_an_intensity_of_0_is_off(felt):
    felt.hear(type="cue", cue=CUE | {"intensity": 0})
    felt.walk(*[1.0] * 6)
    assert felt.of("decision")[0]["reason"] == "off"


@pytest.mark.parametrize("hazard", ["bump", "cliff", "wheel_drop", "over_current", "restarted"])
def test_what_it_feels_halts_it_at_the_next_tick_and_holds(felt, hazard):
    felt.walk(*[1.0] * 6)
    felt.wait(0.5)
    assert not felt.base.read().twist.is_still
    felt.base.senses = Senses(hazards=frozenset({hazard}))
    felt.wait(TICK_S)
    assert felt.base.read().twist == STILL
    assert felt.ended == [hazard]
    assert felt.of("stop") == [{"kind": "stop", "reason": hazard}]
    felt.wait(1)
    assert felt.state == ("stopped", hazard)
    assert felt.base.shown[-1] == (Mood.STOPPED, True)
    felt.base.senses = Senses()
    felt.walk(*[1.0] * 7)
    assert felt.of("decision")[-1]["reason"] == hazard
    felt.hear(type="stop")  # the server's echo of its report
    felt.wait(1)
    assert felt.state == ("stopped", hazard)
    felt.hear(type="arm")
    felt.walk(*[1.0] * 6)
    assert felt.of("decision")[-1]["gesture"] == "celebrate"


def test_it_cannot_be_armed_while_something_is_wrong(felt):
    felt.base.senses = Senses(hazards=frozenset({"cliff"}))
    felt.wait(2)
    felt.hear(type="arm")
    assert felt.of("stop") == [{"kind": "stop", "reason": "cliff"}] * 2
    felt.wait(1)
    assert felt.state == ("stopped", "cliff")
    assert felt.of("status")[-1]["counters"] == {"refused_arms": 1}


def test_its_button_stops_it_for_everyone(felt):
    felt.walk(*[1.0] * 6)
    felt.base.senses = Senses(stop_pressed=True)
    felt.wait(TICK_S)
    felt.base.senses = Senses()
    assert felt.of("stop") == [{"kind": "stop", "reason": "button"}]
    felt.wait(1)
    assert felt.state == ("stopped", "button")


def test_no_gesture_of_a_real_base_while_no_page_of_a_pt_is_open(felt):
    felt.hear(type="heartbeat", watched=False)
    felt.walk(*[1.0] * 6)
    assert felt.of("decision")[-1]["reason"] == "unwatched"
    assert felt.state == ("idle", "unwatched")
    felt.hear(type="heartbeat", watched=True)
    felt.walk(*[1.0] * 5)
    assert felt.of("decision")[-1]["gesture"] == "celebrate"
    felt.hear(type="heartbeat", watched=False)  # what runs comes home
    felt.wait(5)
    assert felt.ended == ["done"]


def test_a_server_that_says_nothing_of_pages_has_none(felt):
    felt.hear(**{name: value for name, value in WELCOME.items() if name != "watched"})
    felt.walk(*[1.0] * 6)
    assert felt.of("decision")[-1]["reason"] == "unwatched"


def test_nobody_need_look_at_a_simulation(stage):
    stage.hear(**WELCOME | {"watched": False})
    stage.walk(*[1.0] * 6)
    assert stage.of("decision")[-1]["gesture"] == "celebrate"


def test_a_base_that_is_held_stops_for_good(felt):
    felt.base.is_held = True
    felt.walk(*[1.0] * 6)
    felt.wait(3)
    assert felt.of("stop") == [{"kind": "stop", "reason": "stalled"}]
    felt.wait(1)
    assert felt.state == ("stopped", "stalled")


def test_a_robot_that_hung_mid_gesture_does_not_go_on(felt):
    felt.walk(*[1.0] * 6)
    felt.wait(0.5)
    felt.now_s += 0.5
    felt.hear(type="heartbeat")
    felt.wait(TICK_S)
    assert felt.base.read().twist == STILL
    assert felt.ended == ["order_lapsed"]


def test_a_robot_without_a_session_waits_for_one():
    stage = Stage()
    stage.hear(type="welcome", session=None)
    stage.heartbeats = False
    stage.wait(5)
    assert stage.robot.is_linked
    assert stage.state == ("idle", "no_session")


# --- bad input ------------------------------------------------------------------------------------

BAD = [
    {"type": "welcome", "session": "7"},
    {"type": "welcome", "session": True, "state": "running", "cue": CUE},
    {"type": "welcome", "session": 9},
    {"type": "welcome", "session": 9, "cue": CUE},
    {"type": "welcome", "session": 9, "cue": CUE | {"window_s": math.nan}, "state": "running"},
    {"type": "welcome", "session": 9, "cue": CUE, "state": "running", "stopped": "no"},
    {"type": "step"},
    {"type": "step", "time_s": "1", "performance": 1},
    {"type": "step", "time_s": math.nan, "performance": 1},
    {"type": "step", "time_s": 1, "performance": math.inf},
    {"type": "step", "time_s": 1e300, "performance": 1},
    {"type": "step", "time_s": 1, "performance": None},
    {"type": "step", "time_s": 1, "performance": 10**400},
    {"type": "welcome", "session": 9, "cue": CUE, "state": "running", "watched": 1},
    {"type": "heartbeat", "watched": "yes"},
    {"type": "state"},
    {"type": "state", "state": {}},
    {"type": "cue"},
    {"type": "cue", "cue": {"above": "celebrate"}},
    {"type": "gesture", "gesture": "celebrate"},
    {"type": "drive", "v_m_s": 1},
    {"type": ["arm"]},
    {"type": None},
    {},
]


@pytest.mark.parametrize("bad", BAD, ids=str)
def test_what_is_not_the_protocol_is_counted_and_moves_nothing(stage, bad):
    stage.walk(0.95, 0.95)
    stage.robot.hear(bad, stage.now_s)
    assert stage.robot.bad_messages == 1
    assert len(stage.robot.last_bad) > 15
    stage.wait(2)
    assert stage.base.read().pose == HOME
    assert stage.of("status")[-1]["bad_messages"] == 1


json_values = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats() | st.text(max_size=5),
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(st.text(max_size=5), inner),
    max_leaves=5,
)
kinds = st.sampled_from(["welcome", "state", "cue", "stop", "arm", "heartbeat", "step", "error"])
frames = st.fixed_dictionaries(
    {"type": kinds | json_values},
    optional={
        "session": st.sampled_from([7, 8, None]) | json_values,
        "state": st.sampled_from(["running", "paused"]) | json_values,
        "cue": st.just(CUE) | json_values,
        "stopped": st.booleans() | json_values,
        "watched": st.booleans() | json_values,
        "time_s": st.floats(0, 60) | json_values,
        "performance": st.floats(0, 2) | json_values,
    },
)


@settings(max_examples=80, deadline=None)
@given(st.lists(st.tuples(frames, st.integers(0, 25)), max_size=40))
def test_any_json_moves_a_base_only_by_gestures_that_were_told(told):
    """It never raises; and whatever moves is a gesture that was decided, armed and not stopped."""
    stage = Stage(RealBase)
    armed = False
    for message, ticks in told:
        stage.robot.hear(message, stage.now_s)
        armed = armed or message["type"] == "arm"
        if message["type"] == "stop":
            armed = False
            assert stage.base.read().twist == STILL
        for _ in range(ticks):
            stage.now_s += TICK_S
            stage.robot.tick(stage.now_s)
            moving = not stage.base.read().twist.is_still
            assert not moving or (armed and stage.robot.player.is_busy and stage.robot.is_linked)
        stage.collect()


# --- rehearsals -----------------------------------------------------------------------------------


def test_a_rehearsal_is_a_live_robot_on_another_clock(stage):
    performances = [0.5 + (number * 37 % 60) / 60 for number in range(60)]
    stage.walk(*performances)
    stage.wait(5)
    rehearsal = Rehearsal("kinematic", CUE)
    rehearsal.walk(zip(range(60), performances, strict=True))
    assert rehearsal.decisions == stage.of("decision")
    assert [gesture["outcome"] for gesture in rehearsal.gestures] == stage.ended
    assert len(rehearsal.gestures) > 5
    starts = [t for t, r in stage.reports if r.get("phase") == "started"]
    assert [g["started_s"] + 1000 for g in rehearsal.gestures] == pytest.approx(starts, abs=0.03)


def test_nothing_moves_at_a_null_base():
    rehearsal = Rehearsal("null", CUE)
    rehearsal.walk((number, 1.0) for number in range(30))
    assert {decision["reason"] for decision in rehearsal.decisions} == {"base_cannot_move"}
    assert not rehearsal.gestures


def test_a_rehearsal_refuses_what_a_robot_would():
    with pytest.raises(ValueError, match="window_s"):
        Rehearsal("kinematic", CUE | {"window_s": 0})
    for name in ("twin", "kobuki"):
        with pytest.raises(ValueError, match="no simulation"):
            Rehearsal(name, CUE)


@pytest.mark.parametrize(
    ("battery_v", "share", "low"), [(None, None, False), (16.5, 1, False), (13.9, 0.25, True)]
)
def test_the_battery_is_told_as_people_read_it(felt, battery_v, share, low):
    felt.base.senses = Senses(battery_v=battery_v)
    felt.wait(1.1)
    status = felt.of("status")[-1]
    assert status["battery_v"] == battery_v
    assert status["battery_share"] == (share if share is None else pytest.approx(share, abs=0.01))
    assert status["battery_low"] is low


@pytest.mark.parametrize("first_s", [0.0, 1.8e9, -1e10, 1e10 - 100])  # of a device, Unix, any
def test_steps_of_any_clock_are_answered(first_s):
    stage = Stage()
    stage.source_s = first_s
    stage.hear(**WELCOME)
    stage.walk(*[1.2] * 7)
    assert stage.robot.bad_messages == 0
    assert [one["gesture"] for one in stage.of("decision")] == ["celebrate"]
