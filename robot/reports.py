"""What a robot tells the server: docs/protocol.md is the contract."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from robot.activation import Decision
from robot.bases.base import BaseState

Report = dict[str, Any]


def status_report(
    base: str,
    state: str,
    reason: str,
    gesture: str | None,
    there: BaseState,
    bad_messages: int,
    counters: Mapping[str, int],
) -> Report:
    """Say how it is. Of the counters, those that counted something."""
    pose = there.pose
    return {
        "kind": "status",
        "base": base,
        "state": state,
        "gesture": gesture,
        "pose": {"x_m": pose.x_m, "y_m": pose.y_m, "heading_rad": pose.heading_rad},
        "reason": reason,
        "battery_v": there.senses.battery_v,
        "bad_messages": bad_messages,
        "counters": {name: count for name, count in counters.items() if count},
    }


def decision_report(
    decision: Decision, gesture: str | None, reason: str, share: float | None
) -> Report:
    """Say what a window came to, and what follows."""
    return {
        "kind": "decision",
        "from_s": decision.from_s,
        "until_s": decision.until_s,
        "steps": decision.steps,
        "mean": decision.mean,
        "threshold": decision.threshold,
        "above": decision.above,
        "gesture": gesture,
        "reason": reason,
        "activated_share": share,
    }


def gesture_report(name: str, phase: str, outcome: str) -> Report:
    """Say that a gesture started or ended."""
    return {"kind": "gesture", "name": name, "phase": phase, "outcome": outcome}


def stop_report(reason: str) -> Report:
    """Say that it has stopped itself, or cannot follow an arming."""
    return {"kind": "stop", "reason": reason}
