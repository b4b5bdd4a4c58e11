"""Reports of a robot to the server (docs/protocol.md)."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from robot.bases.base import BaseState, MobileBase
from robot.behavior.window_decider import Decision

Report = dict[str, Any]


def status_report(
    base: MobileBase,
    state: str,
    reason: str,
    gesture: str | None,
    there: BaseState,
    battery: tuple[float | None, bool],
    bad_messages: int,
    counters: Mapping[str, int],
) -> Report:
    """Return the report of a robot's status.

    ``battery`` is its share (0 to 1) and whether that is low. Counters at 0 are omitted.
    """
    pose, (battery_share, is_low) = there.pose, battery
    return {
        "kind": "status",
        "base": base.name,
        "simulated": base.abilities.simulated,
        "open_loop": not base.abilities.closed_loop,
        "bumpers": base.abilities.bumpers,
        "state": state,
        "gesture": gesture,
        "pose": {"x_m": pose.x_m, "y_m": pose.y_m, "heading_rad": pose.heading_rad},
        "reason": reason,
        "battery_v": there.sensors.battery_v,
        "battery_share": battery_share,
        "battery_low": is_low,
        "bad_messages": bad_messages,
        "counters": {name: count for name, count in counters.items() if count},
    }


def decision_report(
    decision: Decision,
    gesture: str | None,
    intensity: float | None,
    reason: str,
    share: float | None,
) -> Report:
    """Return the report of a decision, and of the gesture that follows or why none does."""
    return {
        "kind": "decision",
        "from_s": decision.from_s,
        "until_s": decision.until_s,
        "steps": decision.steps,
        "mean": decision.mean,
        "threshold": decision.threshold,
        "above": decision.above,
        "gesture": gesture,
        "intensity": intensity,
        "reason": reason,
        "activated_share": share,
    }


def gesture_report(name: str, phase: str, outcome: str, *, open_loop: bool) -> Report:
    """Return the report that a gesture started or ended, labeled where its loop is open."""
    report = {"kind": "gesture", "name": name, "phase": phase, "outcome": outcome}
    return report | {"open_loop": True} if open_loop else report


def stop_report(reason: str) -> Report:
    """Return the report that the robot stopped itself, or could not be armed."""
    return {"kind": "stop", "reason": reason}
