"""The base that ROS drives, in a time that is told: what it orders, believes, and refuses."""

import json
import math
from argparse import ArgumentParser
from contextlib import suppress

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from robot.base_options import add_base_arguments, make_base
from robot.bases import BASES, BadOption
from robot.bases.rosbridge import RosbridgeBase
from robot.bases.rosbridge.topics import PROFILES, Topics
from robot.behavior.performer import Performer
from robot.behavior.safety import BASE_SILENT_S, OPEN_LOOP_MOST
from robot.motion.gestures import GESTURES, ORIGINALS
from robot.motion.limits import CEILING_M_S, CEILING_RAD_S, TICK_S
from robot.motion.pose import HOME
from robot.motion.twist import STILL, Twist
from robot.play_gesture import play
from robot.ros.frames import BadFrame, Topic, read_frame, to_text
from tests.robot.fake_ros import FakeBase, FakeRosbridge
from tests.robot.test_performer import CUE, WELCOME
from tests.robot.test_ros_frames import ANYTHING

pytestmark = pytest.mark.realtime

CMD, ODOM = PROFILES["plain"].order, PROFILES["plain"].odometry
BUMPER = Topic("/bumper", "std_msgs/Bool")
CLOSED = Topics(CMD, ODOM, {"bump": BUMPER})
OPEN = Topics(CMD)


class Stage:
    """A base, a bridge and what it drives; ``wait`` lets time pass, a tick after the other."""

    def __init__(self, topics=CLOSED, has_rosapi=True):
        self.now_s = 100.0
        self.bridge = FakeRosbridge(has_rosapi=has_rosapi)
        self.robot = FakeBase(self.bridge.graph, lambda: self.now_s)
        self.bridge.graph.advertise(BUMPER.name, BUMPER.kind, "/base")
        self.base = RosbridgeBase(lambda: self.now_s, topics)
        self.talk = self.base._conversation
        self.is_frozen = False  # nothing passes any more, and nobody is told; later it does
        self.inbox, self.outbox, self.client = [], [], None
        self.performer = None
        self.connect()
        self.wait(0.2)

    def connect(self):
        self.client = self.bridge.join(self.inbox.append)
        for frame in self.talk.open(self.now_s):
            self.client.take(to_text(frame))

    def lose(self):
        self.client.is_there, self.client = False, None
        self.inbox.clear()
        self.outbox.clear()
        self.talk.lose(self.now_s)

    def wait(self, span_s, order=STILL):
        for _ in range(round(span_s / TICK_S)):
            self.now_s += TICK_S
            if self.performer is None:
                self.base.drive(order)
            else:
                self.performer.hear({"type": "heartbeat"}, self.now_s)
                self.performer.tick(self.now_s)
            self.pass_on()

    def pass_on(self):
        if self.client is not None:
            self.outbox += map(to_text, self.talk.due(self.now_s))
        while self.outbox and not self.is_frozen:
            self.client.take(self.outbox.pop(0))
        self.robot.tell()
        while self.inbox and not self.is_frozen:
            with suppress(BadFrame):
                self.talk.hear(read_frame(self.inbox.pop(0)), self.now_s)

    def tell(self, topic, message):
        self.inbox.append(json.dumps({"op": "publish", "topic": topic, "msg": message}))
        self.pass_on()

    def perform(self, cue=CUE):
        """Have a performer drive it, armed, with a gesture begun."""
        self.performer = Performer(self.base)
        self.performer.hear(WELCOME | {"cue": cue}, self.now_s)
        self.performer.hear({"type": "arm"}, self.now_s)
        for number in range(6):
            step = {"type": "step", "time_s": float(number), "performance": 1.2}
            self.performer.hear(step, self.now_s)
        return self

    def begin_moving(self):
        self.perform().wait(0.5)
        assert self.robot.is_moving
        return self

    def of(self, kind):
        return [report for report in self.performer.reports if report["kind"] == kind]


@pytest.fixture
def stage():
    return Stage()


def moving(stage):
    return [order for order in stage.robot.orders if order[1] or order[2]]


# --- what every base promises -------------------------------------------------------------------


def test_it_is_a_base_that_no_program_arms(stage):
    assert BASES[stage.base.name] is RosbridgeBase
    assert not RosbridgeBase.abilities.simulated
    assert RosbridgeBase.abilities.closed_loop
    assert RosbridgeBase.abilities.bumpers


def test_it_begins_at_home_wherever_that_is(stage):
    there = stage.base.read()
    assert there.pose.distance_m(HOME) < 1e-9
    assert there.twist == STILL
    assert there.senses.silent_s == 0


@pytest.mark.parametrize("bad", [Twist(math.nan, 0), Twist(0.1, math.inf)])
def test_an_order_that_is_not_finite_stops_it(stage, bad):
    stage.wait(0.1, Twist(0.1, 0))
    assert stage.robot.is_moving
    assert stage.base.drive(bad) == STILL
    stage.pass_on()
    assert not stage.robot.is_moving


def test_it_says_what_was_really_ordered(stage):
    sent = stage.base.drive(Twist(9, -9))
    assert abs(sent.v_m_s) <= CEILING_M_S
    assert abs(sent.w_rad_s) <= CEILING_RAD_S
    stage.pass_on()
    assert stage.robot.orders[-1][1:] == (sent.v_m_s, sent.w_rad_s)


def test_an_order_grows_old_and_does_not_go_on_by_itself(stage):
    stage.wait(0.1, Twist(0.1, 0.2))
    for _ in range(14):  # whoever orders, hangs
        stage.now_s += TICK_S
        stage.pass_on()
    assert not stage.robot.is_moving
    assert stage.base.counters["lapsed"] == 1
    assert stage.base.drive(Twist(0.1, 0.2)) == STILL
    stage.wait(0.1)
    assert stage.base.drive(Twist(0.1, 0.2)) == Twist(0.1, 0.2)


def test_stopping_waits_for_nothing(stage):
    stage.wait(0.1, Twist(0.1, 0))
    stage.is_frozen = True  # nothing comes back any more
    stage.wait(0.1, Twist(0.1, 0))
    stage.base.stop()
    assert stage.talk.orders.due(stage.now_s) == STILL


def test_home_is_where_it_is_put_and_poses_are_seen_from_there(stage):
    stage.robot.heading_rad += 1.0
    stage.wait(0.1)
    stage.base.set_home()
    stage.wait(1.0, Twist(0.1, 0))
    pose = stage.base.read().pose
    assert pose.x_m == pytest.approx(0.1, abs=0.005)
    assert pose.y_m == pytest.approx(0, abs=1e-9)
    assert pose.heading_rad == pytest.approx(0)


def test_headings_add_up_over_full_turns(stage):
    stage.wait(8.0, Twist(0, 1.5))
    assert stage.base.read().pose.heading_rad == pytest.approx(12.0, abs=0.1)


# --- drop, never queue --------------------------------------------------------------------------


def test_one_order_is_on_its_way_and_the_newest_waits(stage):
    stage.is_frozen = True
    for number in range(1, 10):
        stage.wait(TICK_S, Twist(number / 100, 0))
    assert len(stage.outbox) == 1
    stage.is_frozen = False
    stage.pass_on()  # it comes back, and only the newest follows
    stage.pass_on()
    assert [order[1] for order in moving(stage)] == [0.01, 0.09]
    assert stage.base.counters["dropped"] == 7


def test_what_arrives_late_is_followed_by_standing_still(stage):
    stage.is_frozen = True
    stage.wait(2.0, Twist(0.1, 0))
    stage.is_frozen = False
    stage.pass_on()
    assert [order[1] for order in moving(stage)] == [0.1]
    assert not stage.robot.is_moving
    stage.wait(0.5, Twist(0.1, 0))
    assert not stage.robot.is_moving


def test_nothing_old_is_said_after_a_reconnection(stage):
    stage.wait(0.1, Twist(0.2, 0))
    stage.lose()
    stage.wait(1.0, Twist(0.2, 0))
    before = len(stage.robot.orders)
    stage.connect()
    stage.wait(0.5, Twist(0.2, 0))  # whoever orders has noticed nothing
    after = stage.robot.orders[before:]
    assert after
    assert all(order[1:] == (0.0, 0.0) for order in after)
    assert stage.base.counters["refused"] > 0
    stage.wait(0.1)
    stage.wait(0.1, Twist(0.1, 0))
    assert stage.robot.is_moving


def test_a_first_stop_that_gets_lost_is_said_again():
    stage = Stage()
    stage.lose()
    stage.bridge.loses = 3
    before = len(stage.robot.orders)
    stage.connect()
    stage.wait(0.25, Twist(0.1, 0))
    assert len(stage.robot.orders) == before
    assert stage.base.read().senses.silent_s > BASE_SILENT_S  # and until then nobody may move it
    stage.wait(0.25)
    assert stage.base.read().senses.silent_s < BASE_SILENT_S
    assert not moving(stage)


orders = st.builds(Twist, st.sampled_from([0.0, 0.0, 0.05, 0.1]), st.sampled_from([0.0, 0.4]))
deeds = st.sampled_from(["pass", "pass", "wait", "freeze", "thaw", "lose", "connect"])


@settings(max_examples=150)
@given(st.lists(st.tuples(deeds, orders), max_size=60))
def test_whatever_happens_the_base_hears_fresh_orders_only(story):
    stage = Stage()
    since_s, given_s = -math.inf, {}
    for deed, order in story:
        stage.now_s += TICK_S
        match deed:
            case "wait":
                stage.now_s += 0.3
            case "freeze" | "thaw":
                stage.is_frozen = deed == "freeze"
            case "lose" if stage.client is not None:
                stage.lose()
            case "connect" if stage.client is None:
                stage.connect()
                since_s = stage.now_s
        sent = stage.base.drive(order)
        given_s[sent] = stage.now_s
        heard = len(stage.robot.orders)
        stage.pass_on()
        # What comes late is followed at once by what holds.
        for at_s, v_m_s, w_rad_s in stage.robot.orders[heard:][-1:]:
            twist = Twist(v_m_s, w_rad_s)
            if not twist.is_still:
                assert at_s - given_s[twist] <= 0.25
                assert given_s[twist] >= since_s


# --- what it feels, and what stops it -----------------------------------------------------------


@pytest.mark.parametrize("topics", [CLOSED, OPEN], ids=["closed", "open"])
def test_a_link_that_is_lost_without_a_word_stops_it_on_our_side(topics):
    stage = Stage(topics).begin_moving()
    stage.is_frozen = True
    stage.wait(0.3)
    assert stage.of("stop") == [{"kind": "stop", "reason": "base_silent"}]
    stage.wait(0.5)
    assert not stage.robot.is_moving  # by its own timeout; ours does not reach it
    stage.is_frozen = False
    stage.wait(1.0)
    assert not stage.robot.is_moving
    assert stage.of("status")[-1]["state"] == "stopped"


def test_odometry_that_goes_stale_stops_it(stage):
    stage.begin_moving()
    stage.robot.is_mute = True
    stage.wait(0.24)
    assert not stage.robot.is_moving
    assert stage.of("stop")[0]["reason"] == "base_silent"
    stage.wait(1.0)
    assert "No nav_msgs/Odometry comes on /odom" in stage.talk.problem(stage.now_s)


def test_odometry_that_does_not_move_stops_it(stage):
    stage.begin_moving()
    stage.robot.goes = 0.0
    stage.wait(1.0)
    assert stage.of("stop")[0]["reason"] == "stalled"
    assert not stage.robot.is_moving


def test_a_bump_stops_it_in_place_and_holds(stage):
    stage.begin_moving()
    stage.tell(BUMPER.name, {"data": True})
    stage.wait(0.04)
    assert not stage.robot.is_moving
    assert stage.of("stop")[0]["reason"] == "bump"
    stage.wait(1.0)
    stage.performer.hear({"type": "arm"}, stage.now_s)
    assert stage.performer.safety.latch == "bump"  # it is pressed still
    stage.tell(BUMPER.name, {"data": False})
    stage.wait(0.2)
    stage.performer.hear({"type": "arm"}, stage.now_s)
    assert stage.performer.safety.latch == ""


def test_a_kobuki_s_own_feelers():
    stage = Stage(PROFILES["kobuki"])
    for hazard, field in (("bump", "bumper"), ("cliff", "sensor"), ("wheel_drop", "wheel")):
        topic = PROFILES["kobuki"].feelers[hazard].name
        stage.tell(topic, {field: 1, "state": 1})
        assert hazard in stage.base.read().senses.hazards
        stage.tell(topic, {field: 0, "state": 0})  # another one
        stage.now_s += 1
        assert hazard in stage.base.read().senses.hazards
        stage.tell(topic, {field: 1, "state": 0})
        stage.now_s += 1
        assert hazard not in stage.base.read().senses.hazards


def test_odometry_that_jumps_stops_it(stage):
    stage.begin_moving()
    stage.robot.x_m += 2.0
    stage.wait(0.04)
    assert stage.of("stop")[0]["reason"] == "restarted"


def test_another_program_that_drives_it_stops_it(stage):
    stage.begin_moving()
    stage.bridge.graph.publish(CMD.name, {"linear": {"x": 0.3}, "angular": {"z": 0.0}})
    stage.wait(0.04)
    assert stage.of("stop")[0]["reason"] == "other_driver"
    assert stage.base.counters["foreign"] == 1


def test_another_program_that_holds_it_still_is_welcome(stage):
    stage.begin_moving()
    stage.bridge.graph.publish(CMD.name, {"linear": {"x": 0.0}, "angular": {"z": 0.0}})
    stage.wait(0.04)
    assert not stage.of("stop")


messages = st.one_of(
    ANYTHING,
    st.fixed_dictionaries({"data": ANYTHING}),
    st.fixed_dictionaries({"linear": ANYTHING, "angular": ANYTHING}),
    st.fixed_dictionaries(
        {
            "linear": st.fixed_dictionaries({"x": ANYTHING}),
            "angular": st.fixed_dictionaries({"z": ANYTHING}),
        }
    ),
    st.fixed_dictionaries(
        {"pose": st.fixed_dictionaries({"pose": ANYTHING}), "twist": ANYTHING | st.none()}
    ),
)
frames = st.one_of(
    ANYTHING,
    st.fixed_dictionaries(
        {"op": st.just("publish"), "topic": st.sampled_from(["/cmd_vel", "/odom", "/bumper", "/x"])}
        | {"msg": messages}
    ),
    st.fixed_dictionaries(
        {"op": st.just("service_response"), "id": st.sampled_from(["/cmd_vel", "/bumper", ""])}
        | {"values": ANYTHING, "result": st.booleans()}
    ),
)


@settings(max_examples=200)
@given(st.lists(frames, max_size=5))
def test_no_frame_of_a_bridge_moves_it_or_ends_it(said):
    stage = Stage()
    for frame in said:
        stage.inbox.append(json.dumps(frame))
        stage.wait(TICK_S)
    assert not moving(stage)
    assert stage.base.read().pose.is_finite


# --- what it refuses ----------------------------------------------------------------------------


def test_a_driver_that_is_not_there_is_told():
    stage = Stage()
    stage.bridge.graph.hearers[CMD.name].pop(0)
    stage.wait(2.5)
    assert stage.base.read().senses.refusal == "nobody_listens"
    assert "No driver listens on /cmd_vel" in stage.talk.problem(stage.now_s)
    stage.bridge.graph.subscribe(CMD.name, CMD.kind, stage.robot.follow)
    stage.wait(2.5)
    assert stage.base.read().senses.refusal == ""


def test_a_bumper_that_was_promised_and_is_not_there_is_told(stage):
    stage.bridge.graph.publishers[BUMPER.name].clear()
    stage.wait(2.5)
    assert stage.base.read().senses.refusal == "feeler_missing"
    assert "/bumper" in stage.talk.problem(stage.now_s)


def test_without_rosapi_nobody_knows_and_it_moves():
    stage = Stage(has_rosapi=False).begin_moving()
    assert stage.base.read().senses.refusal == ""


def test_what_does_not_come_back_is_told():
    stage = Stage()
    stage.lose()
    stage.bridge.graph.types[CMD.name] = "geometry_msgs/TwistStamped"
    stage.connect()
    stage.wait(1.5)
    assert stage.base.read().senses.silent_s == math.inf
    assert "comes back" in stage.talk.problem(stage.now_s)
    assert stage.bridge.log


# --- gestures -----------------------------------------------------------------------------------


@pytest.mark.parametrize("name", GESTURES | ORIGINALS)
@pytest.mark.parametrize("goes", [1.0, 0.93])
def test_every_gesture_closed_on_odometry_ends_at_home(name, goes):
    stage = Stage()
    stage.robot.goes = goes

    def sleep(span_s):
        stage.now_s += span_s
        stage.pass_on()

    played = play((GESTURES | ORIGINALS)[name], stage.base, lambda: stage.now_s, sleep)
    assert played["outcome"] == "done"
    assert played["abilities"]["closed_loop"]
    x_m, y_m = stage.robot.x_m - 3.0, stage.robot.y_m + 2.0
    assert math.hypot(x_m, y_m) < 0.02
    assert abs(math.remainder(stage.robot.heading_rad - 3.0, math.tau)) < math.radians(2)


def test_a_session_s_gesture_in_a_closed_loop(stage):
    stage.perform().wait(8)
    assert [report["outcome"] for report in stage.of("gesture")] == ["", "done"]
    assert not any("open_loop" in report for report in stage.of("gesture"))
    status = stage.of("status")[-1]
    assert (status["open_loop"], status["bumpers"]) == (False, True)


@pytest.mark.parametrize("name", GESTURES)
def test_an_open_loop_is_short_timed_and_told(name):
    stage = Stage(OPEN)
    stage.robot.odometry = ""
    stage.perform(CUE | {"above": name}).wait(6)
    started, ended = stage.of("gesture")
    assert (ended["outcome"], ended["open_loop"], started["open_loop"]) == ("done", True, True)
    assert stage.of("decision")[0]["intensity"] == 0.5
    status = stage.of("status")[-1]
    assert (status["open_loop"], status["bumpers"]) == (True, False)
    # It follows its orders here, and so is home.
    assert math.hypot(stage.robot.x_m - 3.0, stage.robot.y_m + 2.0) < 0.02
    span_s = moving(stage)[-1][0] - moving(stage)[0][0]
    assert 0.5 < span_s < 4.0


@pytest.mark.parametrize("name", ORIGINALS)
def test_an_open_loop_refuses_what_is_long(name):
    stage = Stage(OPEN).perform(CUE | {"above": name})
    assert stage.of("decision")[0]["reason"] == "open_loop"
    stage.wait(1)
    assert not moving(stage)


def test_an_open_loop_has_to_be_looked_at_after_so_many_gestures():
    stage = Stage(OPEN).perform()
    told = [stage.performer.decision]
    for number in range(6, 5 * OPEN_LOOP_MOST + 6):
        stage.wait(1)
        step = {"type": "step", "time_s": float(number), "performance": 1.2}
        stage.performer.hear(step, stage.now_s)
        told += [stage.performer.decision] * (stage.performer.decision is not told[-1])
    assert len(told) == OPEN_LOOP_MOST + 1
    assert len(moving(stage)) > 0
    assert stage.of("decision")[-1]["reason"] == "place_unknown"
    assert stage.of("decision")[-2]["reason"] == ""
    stage.performer.hear({"type": "arm"}, stage.now_s)
    assert stage.performer.safety.obstacle(stage.base.read()) == ""


# --- the command line ---------------------------------------------------------------------------


def base_of(*words):
    parser = ArgumentParser()
    add_base_arguments(parser)
    return make_base(parser.parse_args(["--base", "rosbridge", *words]), lambda: 0.0)


def test_its_topics_are_chosen():
    base = base_of("--ros-robot", "plain", "--ros-url", "ws://robot:9090")
    assert (base.port, base._conversation.topics) == ("ws://robot:9090", PROFILES["plain"])
    assert not base.abilities.bumpers
    base = base_of("--cmd-topic", "/mux/in", "--cliff-topic", "none", "--bumper-topic", "/b")
    topics = base._conversation.topics
    assert topics.order == Topic("/mux/in", "geometry_msgs/Twist")
    assert topics.feelers["bump"] == Topic("/b", "kobuki_msgs/BumperEvent")
    assert set(topics.feelers) == {"bump", "wheel_drop"}
    base = base_of("--ros-robot", "plain", "--bumper-topic", "/b", "--odom-topic", "none")
    assert base._conversation.topics.feelers["bump"].kind == "std_msgs/Bool"
    assert (base.abilities.bumpers, base.abilities.closed_loop) == (True, False)


@pytest.mark.parametrize(
    ("words", "cure"),
    [
        (["--cmd-topic", "cmd vel"], "Write it like /cmd_vel"),
        (["--odom-topic", "/odom?"], "--odom-topic"),
        (["--bumper-topic", "/b:sensor_msgs/Range"], "Known types: kobuki_msgs/BumperEvent"),
    ],
)
def test_topics_that_cannot_be(words, cure):
    with pytest.raises(BadOption, match=cure):
        base_of(*words)


@pytest.mark.parametrize("url", ["robot:9090", "http://robot:9090", "ws://", "ws://robot:x"])
def test_an_address_that_cannot_be(url, capsys):
    with pytest.raises(SystemExit):
        base_of("--ros-url", url)
    assert "ws://192.168.1.20:9090" in capsys.readouterr().err
