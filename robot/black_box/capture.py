"""Records in a black box what a robot receives, orders, does and reports, and when to retain it."""

from __future__ import annotations

import math

from robot.bases import MobileBase
from robot.behavior.performer import NO_LINK, Message, Performer
from robot.behavior.status import Report
from robot.black_box.recorder import BlackBox

# While it stands at ease, a tick this often [s] is enough; a disk may be a card that wears.
AT_EASE_S = 1.0
AWAKE_S = 3.0  # after it moved or felt something last


class Capture:
    """Captures one performer and its base, on the loop that ticks them.

    Parameters
    ----------
    box
        What records; None for nothing.
    performer
        The robot.
    base
        Its base.
    """

    def __init__(self, box: BlackBox | None, performer: Performer, base: MobileBase) -> None:
        self._box, self._performer = box, performer
        self._latch = ""
        self._awake_s = self._seen_s = -math.inf
        self._is_awake = False
        if box is not None:
            performer.body.status.on_report = self._record_report
            base.on_bytes = self._record_bytes

    def record_message(self, message: Message) -> None:
        """Record a message of the server that was handled just now."""
        if self._box is not None:
            self._box.note(received=message)
            self._look_for_stop()

    def record_tick(self, now_s: float) -> None:
        """Record a tick: what was ordered, and what the base reports."""
        if self._box is None:
            return
        ordered, state = self._performer.body.ordered, self._performer.body.state
        hazards = sorted(state.sensors.hazards)
        if not ordered.is_still or not state.twist.is_still or hazards:
            self._awake_s = now_s
        self._is_awake = self._performer.body.player.is_busy or now_s - self._awake_s < AWAKE_S
        if self._is_awake or now_s - self._seen_s >= AT_EASE_S:
            self._seen_s = now_s
            pose, twist = state.pose, state.twist
            numbers = (*(ordered.v_m_s, ordered.w_rad_s), *(pose.x_m, pose.y_m, pose.heading_rad))
            tick = [round(one, 4) for one in (*numbers, twist.v_m_s, twist.w_rad_s)]
            aside = [round(one, 4) for one in (ordered.vy_m_s, twist.vy_m_s)]
            more = {"hazards": hazards} if hazards else {}
            self._box.note(tick=tick, **more, **({"aside": aside} if any(aside) else {}))
        self._look_for_stop()

    def record_loss(self, reason: str) -> None:
        """Retain the recording: the base is lost."""
        if self._box is not None:
            self._box.retain(reason, self._performer.session)

    def _look_for_stop(self) -> None:
        latch = self._performer.body.safety.latch
        if self._box is not None and latch and latch != self._latch:
            self._box.retain(latch, self._performer.session)
        self._latch = latch

    def _record_report(self, report: Report) -> None:
        if self._box is not None:
            self._box.note(sent=report)
            if report.get("outcome") == NO_LINK:
                self._box.retain(NO_LINK, self._performer.session)

    def _record_bytes(self, data: bytes) -> None:
        if self._box is not None and self._is_awake:
            self._box.note(bytes=data.hex())
