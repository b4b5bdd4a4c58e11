"""`python -m robot doctor`: finds a Kobuki's port, and says what is wrong with it."""

from __future__ import annotations

import sys
import time
from argparse import ArgumentParser
from collections.abc import Iterator, Sequence

from robot.bases.kobuki import KobukiBase
from robot.behavior.safety import BASE_SILENT_S, BATTERY_LOW_V, BATTERY_WARN_V
from robot.port.usb import Diagnosis, check_port, find_port, list_ports

LISTEN_S = 0.5
FRAMES_PER_S = 45.0  # a base sends 50; some may be lost

CURES = {
    "bump": "Something presses its bumper. Make room around it.",
    "cliff": "Its floor sensors see no floor. Put it down; wipe the sensors below it.",
    "wheel_drop": "A wheel hangs in the air. Put it down.",
    "over_current": "A wheel is blocked. Switch it off and look at the wheels.",
    "firmware_unknown": "It does not report its firmware. Switch it off and on.",
    "firmware_refused": "Its firmware is not of version 1. Update it (1.2.0) before it drives.",
}


def listen(port: str) -> Iterator[Diagnosis]:
    """Open a port for a second, with the wheels standing, and yield what the base reports."""
    base = KobukiBase(time.monotonic)
    base.port = port
    with base:
        frames, until_s = base.frames, time.monotonic() + LISTEN_S
        while time.monotonic() < until_s:
            base.stop()
            time.sleep(0.02)
        frames = base.frames - frames
        problem, state, counters = base.problem, base.read(), base.counters
        firmware = base.firmware
    sensors = state.sensors
    if problem:
        yield Diagnosis(f"{port} cannot be opened: {problem}", _cure_opening(problem))
        return
    if sensors.silent_s > BASE_SILENT_S:
        yield Diagnosis(
            f"{port} is open, and nothing that a Kobuki would say comes from it.",
            "Switch the base on. If it is on: this is another device's port, or the cable only "
            "charges.",
        )
        return
    per_s = frames / LISTEN_S
    yield Diagnosis(
        f"It tells {per_s:.0f} times a second how it is.",
        "" if per_s >= FRAMES_PER_S else "Take another USB port or cable; look at the latency.",
    )
    bad = counters["bad_checksums"] + counters["malformed"]
    yield Diagnosis(f"{bad} damaged frames.", "Take another cable." if bad > 1 else "")
    yield Diagnosis(f"Firmware {firmware or 'unknown'}.", CURES.get(sensors.refusal, ""))
    volts = sensors.battery_v or 0.0
    cure = "" if volts >= BATTERY_WARN_V else f"Charge it: below {BATTERY_LOW_V} V it stays still."
    yield Diagnosis(f"Battery {volts:.1f} V{', charging' * sensors.is_charging}.", cure)
    for hazard in sorted(sensors.hazards):
        yield Diagnosis(f"It feels: {hazard}.", CURES.get(hazard, ""))


def _cure_opening(problem: str) -> str:
    words = problem.lower()
    if "exclusively lock" in words or "busy" in words or "access is denied" in words:
        return "Another program has it. Stop that: one GARRY for each base."
    if "permission" in words:
        return "See above: your account may not use it."
    return "Plug the base in, switch it on, and check the name of the port."


def main(arguments: Sequence[str] | None = None) -> int:
    """Print the results of all checks. Return 0 where nothing is wrong, else 1."""
    parser = ArgumentParser(prog="python -m robot doctor", description=__doc__)
    parser.add_argument("--port", help="instead of the one that is found")
    port = parser.parse_args(arguments).port or find_port()
    wrong = 0
    for look in (check_port(port, list_ports()), listen(port)):
        for diagnosis in look:
            wrong += bool(diagnosis.cure)
            cure = f"\n      Cure: {diagnosis.cure}" if diagnosis.cure else ""
            sys.stdout.write(f"{'  !!' if cure else '  ok'}  {diagnosis.what}{cure}\n")
            sys.stdout.flush()
    return 1 if wrong else 0
