"""Who may order a session's robot: any page stops it; only a person at the PT's page moves it."""

from __future__ import annotations

from enum import StrEnum

from rehab.people.models import User
from rehab.sessions.live.auth import Actor
from rehab.sessions.state_messages import Message
from rehab.training.controls import Audience
from robot.wire.frames import BadFrame


class RobotOrder(StrEnum):
    """What a page orders the robot of its session."""

    STOP = "stop"  # at once, until a person arms it
    ARM = "arm"  # it may move again
    DRIVE = "drive"  # to its mark, while a button is held


def read_robot_order(message: Message, page: Audience, actor: Actor) -> RobotOrder:
    """Return what an actor orders on a page of theirs. Raises BadFrame where they may not.

    A device never moves a robot.
    """
    allowed = [RobotOrder.STOP]
    if page is Audience.MONITOR and isinstance(actor, User):
        allowed += [RobotOrder.ARM, RobotOrder.DRIVE]
    order = message.get("order")
    if order not in allowed:
        raise BadFrame(
            f'"order" is one of: {", ".join(allowed)}. Only a person on the therapist\'s page arms '
            "or drives the robot."
        )
    return RobotOrder(order)
