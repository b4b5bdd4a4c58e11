"""Frames of rosbridge v2: the eight operations that are sent, and the three that are received.

A bridge reports no errors (docs/reference/rosbridge.md#behavior), so what matters is confirmed by
its echo. So that nothing waits in a queue, publishers and subscriptions hold one message.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

MAX_FRAME_BYTES = 64 * 1024  # an Odometry with its covariances has 2 KiB

Frame = dict[str, Any]


class BadRosFrame(ValueError):
    """A received frame that is not understood; the message says what would be."""


@dataclass(frozen=True, slots=True)
class Topic:
    """A ROS topic or action: its name, and the type of its messages, as in ``std_msgs/Bool``."""

    name: str
    kind: str


@dataclass(frozen=True, slots=True)
class Publication:
    """A message that was published on a topic we subscribe to."""

    topic: str
    message: Mapping[str, Any]


@dataclass(frozen=True, slots=True)
class ServiceResponse:
    """The response to the service call of that id; ``values`` are None where it failed."""

    call_id: str
    values: Mapping[str, Any] | None


@dataclass(frozen=True, slots=True)
class ActionResult:
    """The end of the goal of that id; ``problem`` says why it was not reached, empty where it was.

    A goal that was canceled is one that was not reached.
    """

    goal_id: str
    problem: str = ""


Incoming = Publication | ServiceResponse | ActionResult

SUCCEEDED = 4  # action_msgs/GoalStatus


def advertise(topic: Topic, *, latch: bool = False) -> Frame:
    """Return the frame that advertises a topic.

    Parameters
    ----------
    topic
        What will be published on.
    latch
        Whether later subscribers get the last message.
    """
    return {
        "op": "advertise",
        "topic": topic.name,
        "type": topic.kind,
        "latch": latch,
        "queue_size": 1,
    }


def unadvertise(topic: Topic) -> Frame:
    """Return the end of an advertisement."""
    return {"op": "unadvertise", "topic": topic.name}


def publish(topic: Topic, message: Mapping[str, Any]) -> Frame:
    """Return the frame that publishes ``message`` on ``topic``."""
    return {"op": "publish", "topic": topic.name, "msg": dict(message)}


def subscribe(topic: Topic, *, newest_every_ms: int = 0) -> Frame:
    """Return a subscription: to each message, or to the newest at an interval [ms].

    Parameters
    ----------
    topic
        The topic.
    newest_every_ms
        Interval [ms] at which the newest message is sent; 0 for each message.
    """
    return {
        "op": "subscribe",
        "topic": topic.name,
        "type": topic.kind,
        "id": topic.name,
        "throttle_rate": newest_every_ms,
        "queue_length": 1 if newest_every_ms else 0,
    }


def unsubscribe(topic: Topic) -> Frame:
    """Return the end of a subscription."""
    return {"op": "unsubscribe", "topic": topic.name, "id": topic.name}


def call_service(service: str, arguments: Mapping[str, Any], call_id: str) -> Frame:
    """Return the frame that calls a service.

    Parameters
    ----------
    service
        Its name, such as ``/rosapi/publishers``.
    arguments
        By name.
    call_id
        Id of the call, which its response has too.
    """
    return {"op": "call_service", "service": service, "args": dict(arguments), "id": call_id}


def send_goal(action: Topic, goal: Mapping[str, Any], goal_id: str) -> Frame:
    """Return the frame that sends a goal to an action server of ROS 2, without feedback.

    Parameters
    ----------
    action
        Its name, and its type, as in ``control_msgs/action/FollowJointTrajectory``.
    goal
        The goal's fields.
    goal_id
        Its id, which its result has too.
    """
    return {
        "op": "send_action_goal",
        "action": action.name,
        "action_type": action.kind,
        "args": dict(goal),
        "feedback": False,
        "id": goal_id,
    }


def cancel_goal(action: Topic, goal_id: str) -> Frame:
    """Return the frame that cancels a goal."""
    return {"op": "cancel_action_goal", "action": action.name, "id": goal_id}


def to_text(frame: Frame) -> str:
    """Return a frame's text. Raises ValueError for a number that is not finite."""
    return json.dumps(frame, separators=(",", ":"), allow_nan=False)


def read_frame(text: str | bytes) -> Incoming:
    """Return a publication, a service response or a result. Raises BadRosFrame for others."""
    try:
        frame = json.loads(text)
    except (ValueError, RecursionError):
        raise BadRosFrame("A frame is a JSON object.") from None
    match frame:
        case {"op": "publish", "topic": str(topic), "msg": dict(message)}:
            return Publication(topic, message)
        case {"op": "service_response", "id": str(call_id), **rest}:
            # A failure has its message where the values would be
            # (docs/reference/rosbridge.md#messages).
            values = rest.get("values") if rest.get("result") is True else None
            return ServiceResponse(call_id, values if isinstance(values, dict) else None)
        case {"op": "action_result", "id": str(goal_id), **rest}:
            return ActionResult(goal_id, _read_problem(rest))
    raise BadRosFrame('A received frame has the "op" publish, service_response or action_result.')


def _read_problem(result: Mapping[Any, Any]) -> str:
    """Return why a goal was not reached, in its server's or bridge's words."""
    values, status = result.get("values"), result.get("status")
    if result.get("result") is not True:  # it was rejected, or there is no server
        return values if isinstance(values, str) and values else "it was refused"
    if isinstance(values, dict) and "status" in values:  # bridges of early 2024
        status, values = values["status"], values.get("result")
    if status == SUCCEEDED:
        return ""
    text = values.get("error_string") if isinstance(values, dict) else None
    return text if isinstance(text, str) and text else f"it ended with the status {status}"
