"""When a session lets its robot greet, rest, take leave and idle; and when it stands still."""

from __future__ import annotations

import pytest

from rehab.training.phases import make_phase
from rehab.training.valences import CueGestures
from tests.support.callers import change

CALM = ("baseline", "catch", "washout", "retention")


async def heard_by(robot, kind, count):
    return [await robot.hear(kind) for _ in range(count)]


async def test_start_planned_rest_and_end_are_acted_and_no_other_pause(place, ready):
    phases = (make_phase("training", strides=2, rest_s=60.0), make_phase("training"))
    session = await ready(place, *phases)
    robot, source = await place.robot().dial(), await place.source().dial()
    assert (await robot.hello())["cue"]["idles"] is True
    await change(session, "start")
    await source.hello()
    await source.walk(4.0, 4.0)
    for kind in ("resume", "pause", "resume", "finish"):
        await change(session, kind)
    states = await heard_by(robot, "state", 6)
    assert [(one["state"], one["gesture"]) for one in states] == [
        ("running", "greeting"),
        ("paused", "rest"),
        ("running", None),
        ("paused", None),
        ("running", None),
        ("finished", "farewell"),
    ]


@pytest.mark.parametrize("kind", CALM)
async def test_it_stands_still_in_a_phase_without_feedback(place, ready, kind):
    session = await ready(place, make_phase(kind), make_phase("training"))
    robot = await place.robot().dial()
    assert (await robot.hello())["cue"]["idles"] is False
    await change(session, "start")
    assert (await robot.hear("state"))["gesture"] is None
    await change(session, "phase", 1)
    assert (await robot.hear("cue"))["cue"]["idles"] is True
    await change(session, "phase", 0)
    assert (await robot.hear("cue"))["cue"]["idles"] is False
    await change(session, "finish")
    assert (await robot.hear("state"))["gesture"] is None


async def test_a_phase_that_ends_by_itself_stills_it(place, ready):
    session = await ready(place, make_phase("training", strides=2), make_phase("catch"))
    robot, source = await place.robot().dial(), await place.source().dial()
    await robot.hello()
    await change(session, "start")
    await source.hello()
    await source.walk(4.0, 4.0)
    assert (await robot.hear("cue"))["cue"]["idles"] is False


@pytest.mark.parametrize(
    "options",
    [
        {"valence": "explicit"},
        {"robot_intensity": 0.0},
        {"cue": CueGestures(above="original_positive")},
        {"cue": CueGestures()},
    ],
    ids=str,
)
async def test_it_stands_still_where_it_does_not_choose_its_answers(place, ready, options):
    session = await ready(place, **options)
    robot = await place.robot().dial()
    assert (await robot.hello())["cue"]["idles"] is False
    for kind in ("start", "finish"):
        await change(session, kind)
        assert (await robot.hear("state"))["gesture"] is None


async def test_an_abort_orders_nothing(place, begun):
    session = await begun(place)
    robot = await place.robot().open()
    await change(session, "abort")
    assert await robot.hear("state") == {"type": "state", "state": "aborted", "gesture": None}
