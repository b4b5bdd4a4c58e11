"""A twin that runs by the clock: 50 frames a second, and what is done to it meanwhile."""

from __future__ import annotations

import json
import math
import queue
import time
from collections.abc import Callable, Mapping
from dataclasses import asdict
from functools import partial
from typing import Any

from robot.bases.kobuki_protocol.frames import FRAME_S
from robot.bases.twin.faults import BadFault
from robot.bases.twin.firmware import Firmware
from robot.bases.twin.lines import Line
from robot.motion.pose import HOME
from robot.wire.frames import to_number

HELD_BYTES = 4096  # of a stalled line, as many as a pty holds; the oldest are lost
SKIP_AFTER_S = 0.1  # a twin that is later than this skips the time instead of catching up
LONGEST_S = 3600.0


class Twin:
    """One simulated base at its port, and what is done to it.

    Parameters
    ----------
    firmware
        The base.
    line
        Its port.
    """

    def __init__(self, firmware: Firmware, line: Line) -> None:
        self.firmware, self.line = firmware, line
        self.frames = 0
        self.farthest_m = 0.0  # from home, since the last look
        self.max_delay_s = 0.0  # of a frame, since the last look
        # What is to be undone, and when; a newer order of the same kind takes its place.
        self._scheduled: dict[str, tuple[float, Callable[[], object]]] = {}
        self._stalled_until_s = self._off_until_s = -math.inf
        self._held = b""
        self._described_s = -math.inf

    def receive(self, now_s: float) -> None:
        """Read what the driver has sent, at a time [s]."""
        if now_s < self._stalled_until_s:
            return
        data = self.line.read()
        if data and now_s >= self._off_until_s:
            self.firmware.receive(data, now_s)

    def step(self, now_s: float) -> None:
        """Simulate one frame's time at a time [s], and send the frame."""
        for kind in [kind for kind, (at_s, _) in self._scheduled.items() if at_s <= now_s]:
            self._scheduled.pop(kind)[1]()
        self.receive(now_s)
        if now_s < self._off_until_s:
            self.firmware.body.roll(0.0, 0.0)
            return
        self._held += self.firmware.step(now_s)
        self.frames += 1
        self.farthest_m = max(self.farthest_m, self.firmware.body.pose.distance_m(HOME))
        if now_s >= self._stalled_until_s:
            self.line.write(self._held)
            self._held = b""
        self._held = self._held[-HELD_BYTES:]

    def execute(self, order: Mapping[str, Any], now_s: float) -> dict[str, Any]:
        """Carry out an order to the twin, and return the answer.

        Parameters
        ----------
        order
            A JSON object as in ``python -m robot twin --help``.
        now_s
            The time [s].

        Raises
        ------
        BadFault
            For an unknown order or fault, and for values out of bounds.
        """
        match order:
            case {"do": "set", "name": str(name), "value": value}:
                for_s = _seconds(order) if "for_s" in order else None
                was = self.firmware.faults.change(name, value)
                undo: Callable[[], object] = partial(self.firmware.faults.change, name, was)
                _, undo = self._scheduled.pop(name, (now_s, undo))
                if for_s is not None:
                    self._scheduled[name] = (now_s + for_s, undo)
            case {"do": "stall"}:
                self._stalled_until_s = now_s + _seconds(order)
            case {"do": "vanish"}:
                back_s = now_s + _seconds(order)
                self.line.pull_out()
                self._scheduled["vanish"] = (back_s, self.line.plug_in)
            case {"do": "power_cycle"}:
                self._off_until_s = now_s + _seconds(order)
                self.firmware.switch_on()
                self._scheduled["power_cycle"] = (self._off_until_s, self.firmware.switch_on)
            case {"do": "wall" | "edge" as what}:
                body = self.firmware.body
                put = body.put_wall if what == "wall" else body.put_edge
                try:
                    put(_number(order, "ahead_m", 0.0, 5.0))
                except NotImplementedError as problem:
                    raise BadFault(str(problem)) from None
            case {"do": "carry_home"}:
                self.firmware.carry_home()
                self.farthest_m = 0.0
            case {"do": "look"}:
                return self._describe(now_s)
            case _:
                raise BadFault("What can be done to a twin: see python -m robot twin --help.")
        return {"done": order["do"]}

    def run(
        self,
        orders: queue.Queue[str],
        answer: Callable[[str], None],
        is_over: Callable[[], bool],
        monotonic: Callable[[], float] = time.monotonic,
        sleep: Callable[[float], None] = time.sleep,
    ) -> None:
        """Run by the clock until ``is_over``.

        Parameters
        ----------
        orders
            Lines of JSON to the twin; see ``python -m robot twin --help``.
        answer
            Called with a line of JSON for each order.
        is_over
            Called at each frame.
        monotonic, sleep
            The clock [s], and how to wait by it.
        """
        next_s = monotonic()
        while not is_over():
            now_s = monotonic()
            while now_s < next_s:
                if now_s < self._stalled_until_s:
                    sleep(next_s - now_s)
                else:
                    self.line.wait(next_s - now_s)
                now_s = monotonic()
                self.receive(now_s)
            self.max_delay_s = max(self.max_delay_s, now_s - next_s)
            next_s = next_s + FRAME_S if now_s - next_s < SKIP_AFTER_S else now_s + FRAME_S
            while not orders.empty():
                answer(self._answer(orders.get(), now_s))
            self.step(now_s)

    def _answer(self, line: str, now_s: float) -> str:
        try:
            order = json.loads(line)
            if not isinstance(order, dict):
                raise BadFault('An order is {"do": …}.')
            return json.dumps(self.execute(order, now_s))
        except (ValueError, RecursionError) as problem:  # BadFault and what is no JSON
            return json.dumps({"error": str(problem)})

    def _describe(self, now_s: float) -> dict[str, Any]:
        firmware = self.firmware
        reader = firmware.reader
        seen = {
            "at_s": now_s,
            "body": type(firmware.body).__name__,
            "pose": asdict(firmware.body.pose),
            "farthest_m": self.farthest_m,
            "rolled_m": firmware.body.rolled_m,
            "wheels_m_s": firmware.drive_train.wheels_m_s,
            "setpoint": firmware.control,
            "orders": [
                (order.at_s, *order.control)
                for order in firmware.orders
                if order.at_s > self._described_s
            ],
            "output": firmware.output,
            "sounds": firmware.sounds,
            "frames": self.frames,
            "latest_s": self.max_delay_s,
            "commands": reader.frames,
            "bad_commands": reader.bad_checksums + reader.malformed,
        }
        self._described_s, self.farthest_m, self.max_delay_s = now_s, 0.0, 0.0
        return seen


def _number(order: Mapping[str, Any], name: str, least: float, most: float) -> float:
    value = to_number(order.get(name), least, most)
    if value is None:
        raise BadFault(f"{name} is a number from {least:g} to {most:g}.")
    return value


def _seconds(order: Mapping[str, Any]) -> float:
    return _number(order, "for_s", 0.0, LONGEST_S)
