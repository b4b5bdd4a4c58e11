"""What a plan does by itself while somebody walks, as pages, source, robot and log hear of it."""

from __future__ import annotations

import pytest

from rehab.sessions.log import Step
from rehab.sessions.setup.protocol_models import Protocol
from rehab.training.goal_adaptation import AdaptationMode, GoalAdaptation
from rehab.training.goals import GoalRule, Target
from rehab.training.phases import make_phase
from rehab.training.plans import ROBOT_LEVELS
from rehab.training.robot_cueing import CueTiming
from rehab.training.schedules import Schedule, ScheduleKind
from rehab.training.valences import CueGestures
from robot.wire.cue_limits import CueRule
from tests.support.callers import a_step, events_of, restart

TRAINING = make_phase("training")


async def test_the_robot_gets_the_whole_cue(place, begun):
    timing = CueTiming(CueRule.STREAKS, window_s=8, count=4, rest_s=30)
    await begun(place, TRAINING, activation_threshold=0.75, cue_timing=timing)
    cue = (await (await place.robot().dial()).hello())["cue"]
    assert {name: cue[name] for name in ("threshold", "rule", "window_s", "count", "rest_s")} == {
        "threshold": 0.75,
        "rule": "streaks",
        "window_s": 8,
        "count": 4,
        "rest_s": 30,
    }


async def test_a_close_step_is_told_to_people_and_not_to_the_robot(place, begun):
    protocol = await Protocol.everywhere.acreate(
        clinic=place.patient.clinic, name="close", close_percent=10
    )
    session = await begun(place, TRAINING, protocol=protocol)
    robot, source = await place.robot().dial(), await place.source().dial()
    monitor, tablet = place.monitor(session), place.tablet(session)
    for page in (monitor, tablet):
        await page.watch()
    await robot.hello()
    await source.hello()
    await source.walk(3.01, extra={"a2_sd_w_kg": 0.1})
    told, seen = await tablet.until_step(1), await monitor.until_step(1)
    assert (told["words"], told["emblem"], told["confetti"]) == (
        *("About at the goal.", "neutral", "none"),
    )
    assert (told["close"], told["hit"], told["points"], told["score"]) == (True, True, 0, 0)
    assert (seen["close"], seen["hit"], seen["value"], seen["points"]) == (True, True, 3.01, 0)
    assert (seen["hits"], seen["judged"], seen["hit_rate"]) == (0, 1, None)
    await source.walk(5.0, extra={"a2_sd_w_kg": 0.1})
    assert (await robot.hear("step"))["number"] == 2
    stored = Step.everywhere.order_by("number").values_list("close", "hit", "points")
    assert [row async for row in stored] == [(True, True, 0), (False, True, 1)]

    await restart()
    again = await place.monitor(session).watch()
    assert (again["close"], again["hits"], again["judged"]) == (1, 1, 2)
    assert [step["close"] for step in again["steps"]] == [True, False]


async def test_a_phase_without_the_robot_sends_it_no_steps(place, begun):
    await begun(place, make_phase("training", strides=1, robot=False), TRAINING)
    robot, source = await place.robot().open(), await place.source().open()
    await source.walk(4.0, 5.0)
    assert (await robot.hear("step"))["number"] == 2


async def test_a_robot_that_a_plan_leaves_out_is_no_part_of_the_session(place, begun):
    session = await begun(
        place, make_phase("training", robot=False), robot_intensity=ROBOT_LEVELS["off"]
    )
    robot, monitor = await place.robot().dial(), place.monitor(session)
    assert (await robot.hello())["session"] is None
    assert (await monitor.watch())["presence"]["robot"] is False
    await robot.say({"type": "report", "report": {"kind": "stop", "reason": "base_silent"}})
    assert (await place.monitor(session).watch())["alarms"] == []


@pytest.mark.parametrize("valence", ["positive", "explicit"])
async def test_a_robot_hears_nothing_of_baseline_and_catch(place, begun, valence):
    phases = (make_phase(kind, strides=1) for kind in ("baseline", "catch", "washout", "training"))
    await begun(place, *phases, valence=valence, cue=CueGestures("joy", "disappointment"))
    robot, source = await place.robot().dial(), await place.source().dial()
    cue = (await robot.hello())["cue"]
    assert cue["only_informs"] == (valence == "explicit")
    await source.hello()
    await source.walk(4.0, 5.0, 4.0, 5.0)
    assert (await robot.hear("step"))["number"] == 4


async def test_an_automatic_goal_is_told_logged_and_found_again(place, begun):
    session = await begun(
        place,
        TRAINING,
        adaptation=GoalAdaptation(AdaptationMode.AUTOMATIC, strides=5),
        target=Target(0.6),
    )
    source, monitor = await place.source().open(), place.monitor(session)
    assert (await monitor.watch())["goal_adaptation"] == "automatic"
    await source.walk(*[4.0] * 6)
    goal = 3.0 * (1 + 0.005 * 2)
    told = await monitor.until(lambda event: event["kind"] == "goal")
    assert told["goal"] == goal
    assert [message["goal"] for message in source.heard if message["type"] == "goal"] == [goal]
    (row,) = await events_of(session, "goal_followed")
    assert (row.after_number, row.old, row.value, row.by_id) == (5, 3.0, goal, None)
    steps = [step.goal async for step in Step.everywhere.order_by("number")]
    assert steps == [3.0] * 5 + [goal]

    await restart()
    again = await place.monitor(session).watch()
    assert again["goal"] == goal
    assert {"after": 5, "kind": "goal", "value": goal} in again["marks"]


async def test_twenty_strides_suggest_a_goal_to_the_therapist_alone(place, begun):
    session = await begun(place, TRAINING, target=Target(0.6))
    source, monitor, tablet = (
        await place.source().dial(),
        place.monitor(session),
        place.tablet(session),
    )
    await source.hello()
    assert (await monitor.watch())["suggested_goal"] is None
    await tablet.watch()
    await source.walk(*[4.0] * 20)
    assert (await monitor.until_step(19))["suggested_goal"] is None
    assert (await monitor.until_step(20))["suggested_goal"] == 4.0
    assert "suggested_goal" not in await tablet.until_step(20)


async def test_a_baseline_tells_the_therapist_mean_sd_and_count(place, begun):
    session = await begun(
        place,
        make_phase("baseline", strides=50),
        TRAINING,
        goal=GoalRule(percent_of_baseline=110, asks=True),
    )
    source, monitor = await place.source().open(), place.monitor(session)
    assert (await monitor.watch())["baseline"]["count"] == 0
    await source.walk(3.0, None, 5.0)
    baseline = (await monitor.until_step(3))["baseline"]
    assert baseline == {
        "mean": 4.0,
        "sd": 2.0**0.5,
        "count": 2,
        "needed": 50,
        "goal": 4.4,
        "asks": True,
    } | {"goal": baseline["goal"]}
    assert abs(baseline["goal"] - 4.4) < 1e-9
    await source.walk(*[4.0] * 50)
    waiting = await monitor.until(lambda event: "to accept its goal" in event.get("obstacle", ""))
    assert waiting["goal"] is None
    assert (await monitor.change("phase", 1))["type"] == "done"
    begun_training = await monitor.until(lambda event: event.get("goal") is not None)
    assert begun_training["baseline" if "baseline" in begun_training else "phase"]["index"] == 1


async def test_a_planned_rest_pauses_everyone_until_the_therapist_goes_on(place, begun):
    rested = make_phase("training", strides=2, rest_s=90)
    session = await begun(place, rested, TRAINING)
    source, robot = await place.source().open(), await place.robot().open()
    monitor, tablet = await place.monitor(session).open(), await place.tablet(session).open()
    await source.walk(4.0, 4.0)
    paused = await monitor.until(lambda event: event.get("state") == "paused")
    assert (paused["pause_reason"], paused["rest_s"]) == ("rest", 90)
    await tablet.until(lambda event: event.get("state") == "paused")
    assert (await robot.hear("state"))["state"] == "paused"
    kinds = [message["type"] for message in source.heard]
    assert kinds.index("pause") < len(kinds) - 1  # before the step's acknowledgment
    assert [row.value for row in await events_of(session, "planned_rest")] == [90]
    await source.walk(4.0)
    await source.say(a_step(3))
    await source.acked(3)  # sent again, it is the same step: stored as paused
    stored = await Step.everywhere.aget(session=session, number=3)
    assert stored.reasons == ["paused"]

    await restart()
    again = place.monitor(session)
    assert (await again.watch())["pause_reason"] == "rest"
    assert (await again.change("resume"))["type"] == "done"
    assert (await again.until(lambda event: event.get("state") == "running"))["rest_s"] is None


async def test_a_heart_rate_above_the_limit_pauses_until_it_is_below(place, begun):
    session = await begun(place, TRAINING, heart_rate_limit=120)
    source, monitor = await place.source().open(), await place.monitor(session).open()
    for rate in (120, 121):
        await source.walk(4.0, extra={"heart_rate": rate})
    paused = await monitor.until(lambda event: event.get("state") == "paused")
    assert paused["pause_reason"] == "heart_rate"
    assert len(await events_of(session, "heart_rate_limit")) == 1
    await restart()
    again = place.monitor(session)
    assert (await again.watch())["pause_reason"] == "heart_rate"
    assert (await again.change("resume"))["type"] == "done"
    stored = [one.reasons async for one in Step.everywhere.filter(session=session)]
    assert stored == [[], []]


@pytest.mark.parametrize("locked", [False, True])
async def test_near_the_limit_of_the_heart_rate_no_harder_goal_and_a_gentle_robot(
    place, begun, locked
):
    session = await begun(
        place, TRAINING, heart_rate_limit=120, goal=GoalRule(value=3.0), locked=locked
    )
    source, monitor = await place.source().open(), await place.monitor(session).open()
    robot = place.robot()
    assert (await (await robot.dial()).hello())["cue"]["intensity"] == 1
    await source.walk(*[4.0] * 20, extra={"heart_rate": 107})
    told = await monitor.until_step(20)
    assert (told["is_strained"], told["suggested_goal"]) == (False, 4.0)
    await source.walk(4.0, extra={"heart_rate": 108})
    told = await monitor.until_step(21)
    assert (told["is_strained"], told["suggested_goal"]) == (True, None)
    if not locked:  # a study's arm decides how its robot acts
        assert (await robot.hear("cue"))["cue"]["intensity"] == 0.5
    await restart()
    again = await place.monitor(session).watch()
    assert (again["is_strained"], again["suggested_goal"]) == (True, None)
    robot, source = place.robot(), await place.source().open()
    expected = 1 if locked else 0.5
    assert (await (await robot.dial()).hello())["cue"]["intensity"] == expected
    await source.walk(4.0, extra={"heart_rate": 101})
    if not locked:
        assert (await robot.hear("cue"))["cue"]["intensity"] == 1


async def test_every_third_step_is_told_and_the_score_counts_them_all(place, begun):
    session = await begun(place, TRAINING, schedule=Schedule(interval=3))
    source, tablet = await place.source().open(), await place.tablet(session).open()
    await source.walk(4.0, 2.0, 4.0, 2.0)
    await tablet.until_step(4)
    told = [event for event in tablet.events if "number" in event]
    assert [event["kind"] for event in told] == ["calm", "calm", "step", "calm"]
    assert (told[2]["points"], told[2]["score"]) == (1, 1)
    again = await place.tablet(session).watch()
    assert [step["number"] for step in again["steps"]] == [3]
    assert again["last"]["number"] == 3


async def test_a_summary_tells_hits_mean_and_points_of_its_block(place, begun):
    session = await begun(place, TRAINING, schedule=Schedule(ScheduleKind.SUMMARY, 4))
    source, tablet = await place.source().open(), await place.tablet(session).open()
    await source.walk(6.0, 3.0, None, 1.5, 6.0)
    told = await tablet.until_step(5)
    assert told["summary"] == {"hits": 3, "steps": 4, "close": 0}
    assert (told["performance"], told["hit"], told["points"], told["score"]) == (1.375, True, 2, 2)
    assert told["words"]
    kinds = [event["kind"] for event in tablet.events if "number" in event]
    assert kinds == ["calm"] * 4 + ["step"]


async def test_a_summary_over_a_change_of_type_tells_the_points_that_were_earned(place, begun):
    session = await begun(place, TRAINING, schedule=Schedule(ScheduleKind.SUMMARY, 4))
    source, tablet, monitor = (
        await place.source().open(),
        await place.tablet(session).open(),
        await place.monitor(session).open(),
    )
    await source.walk(6.0, 6.0)  # one point each
    await monitor.change("valence_now", "negative")
    await source.walk(1.5, 6.0)  # one is taken
    told = await tablet.until_step(4)
    assert (told["points"], told["score"]) == (1, 1)
