"""A PT's page drives the robot to its mark; no other page does."""

from __future__ import annotations

import pytest

from tests.support.callers import Message

DRIVE: Message = {"type": "robot", "order": "drive", "ahead": 1, "left": -0.5}


async def test_what_a_held_button_orders_reaches_the_robot(place, ready):
    session = await ready(place)
    robot, monitor = await place.robot().open(), await place.monitor(session).open()
    await monitor.say(DRIVE)
    told = await robot.hear("drive")
    assert told == {"type": "drive", "ahead": 1, "left": -0.5}


async def test_the_button_that_drives_it_home_reaches_the_robot(place, ready):
    session = await ready(place)
    robot, monitor = await place.robot().open(), await place.monitor(session).open()
    await monitor.say(DRIVE | {"ahead": 0, "left": 0, "home": True})
    assert await robot.hear("drive") == {"type": "drive", "ahead": 0, "left": 0, "home": True}


async def test_the_patient_s_page_drives_nothing(place, ready):
    session = await ready(place)
    robot, tablet = await place.robot().open(), await place.tablet(session).open()
    await tablet.say(DRIVE)
    assert (await tablet.sent_away())[0] == 4400
    assert "drive" not in [message["type"] for message in await robot.overhear()]


@pytest.mark.parametrize(
    "bad",
    [{"ahead": -1}, {"ahead": 2}, {"left": "much"}, {"ahead": None}, {"left": 1e9}, {"home": 1}],
)
async def test_a_drive_that_is_none_is_refused(place, ready, bad):
    session = await ready(place)
    monitor = await place.monitor(session).open()
    await monitor.say(DRIVE | bad)
    assert (await monitor.sent_away())[0] == 4400
