"""The base that ROS drives, in a time that is told: what it orders, and that nothing is queued."""

import math

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from robot.bases.rosbridge.orders import IN_FLIGHT, Orders
from robot.behavior.safety import BASE_SILENT_S
from robot.motion.limits import TICK_S
from robot.motion.twist import STILL, Twist
from tests.support.extent import examples
from tests.support.rosbridge_stage import Stage, moving

# --- beside what every base promises (tests/robot/bases/test_contract.py) -------------------------


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
    assert stage.base_client.orders.due(stage.now_s) == STILL


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


def test_four_orders_are_on_their_way_and_the_newest_waits(stage):
    stage.is_frozen = True
    for number in range(1, 10):
        stage.wait(TICK_S, Twist(number / 100, 0))
    assert len(stage.outbox) == IN_FLIGHT == 4
    stage.is_frozen = False
    stage.pass_on()  # it comes back, and only the newest follows
    stage.pass_on()
    assert [order[1] for order in moving(stage)] == [0.01, 0.02, 0.03, 0.04, 0.09]
    assert stage.base.counters["dropped"] == 4


def test_the_echo_of_one_order_confirms_no_later_one_that_is_equal():
    orders = Orders()
    orders.order(STILL, 0.0)
    assert orders.due(0.0) == STILL
    orders.handle_echo(STILL)
    orders.order(STILL, 0.02)

    def send(now_s):
        orders.order(Twist(0.1, 0), now_s)
        return orders.due(now_s)

    assert [send(0.04 + n / 100) for n in range(5)].count(None) == 1
    orders.handle_echo(Twist(0.1, 0))
    assert [send(0.1 + n / 100) for n in range(5)].count(None) == 4


def test_what_arrives_late_is_followed_by_standing_still(stage):
    stage.is_frozen = True
    stage.wait(2.0, Twist(0.1, 0))
    stage.is_frozen = False
    stage.pass_on()
    assert [order[1] for order in moving(stage)] == [0.1] * IN_FLIGHT
    assert stage.robot.orders[-1][1:] == (0.0, 0.0)
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
    assert stage.base.read().sensors.silent_s > BASE_SILENT_S  # and until then nobody may move it
    stage.wait(0.25)
    assert stage.base.read().sensors.silent_s < BASE_SILENT_S
    assert not moving(stage)


orders = st.builds(Twist, st.sampled_from([0.0, 0.0, 0.05, 0.1]), st.sampled_from([0.0, 0.4]))
deeds = st.sampled_from(["pass", "pass", "wait", "freeze", "thaw", "lose", "connect"])


@settings(max_examples=examples(150))
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
