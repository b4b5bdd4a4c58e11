"""What a robot reports to the server and is ordered by pages, and what the log keeps of it."""

from __future__ import annotations

from typing import Any

from rehab.sessions.log import SessionEvent
from rehab.sessions.models import TrainingSession
from tests.support.callers import Message

STATUS = {
    "kind": "status",
    "base": "kinematic",
    "state": "performing",
    "gesture": "celebrate",
    "pose": {"x_m": 0.01, "y_m": 0, "heading_rad": -0.2},
    "reason": "",
}
DECISION = {
    "kind": "decision",
    "from_s": 1.1,
    "until_s": 6.1,
    "steps": 4,
    "mean": 1.2,
    "threshold": 0.9,
    "above": True,
    "gesture": "celebrate",
    "reason": "",
    "activated_share": 0.75,
}
GESTURE = {"kind": "gesture", "name": "celebrate", "phase": "ended", "outcome": "done"}

STOP = {"type": "robot", "order": "stop"}
ARM = {"type": "robot", "order": "arm"}


async def log_of(session: TrainingSession) -> list[Message]:
    """Return what the log has of the session's robot."""
    events = SessionEvent.everywhere.filter(session=session, kind__startswith="robot_")
    fields = ("kind", "by", "data", "after_number")
    return [row async for row in events.order_by("pk").values(*fields)]


def is_stopped(stopped: bool) -> Any:
    """Return a check of an event: that the robot is stopped, or no longer."""
    return lambda event: event == {"kind": "robot_stopped", "stopped": stopped}
