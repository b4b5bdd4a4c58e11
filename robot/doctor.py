"""`python -m robot doctor`: finds a Kobuki's port, and says what is wrong with it.

With --cut it tries the hardware cut (docs/safety.md), with the wheels off the floor: it sends
nothing for some seconds, then asks for the emergency stop to be pressed, and says whether the base
lost its power.
"""

from __future__ import annotations

import sys
import time
from argparse import ArgumentParser
from collections.abc import Iterator, Sequence

from robot.bases import BASES
from robot.bases.kobuki import STOP_FRAME, KobukiBase
from robot.bases.kobuki_protocol.frames import BAUD
from robot.behavior.safety import BASE_SILENT_S, BATTERY_LOW_V, BATTERY_WARN_V
from robot.motion.gestures import GESTURES
from robot.port.opening import PortOpener
from robot.port.owner import SerialPort
from robot.port.priority import explain_jitter, find_priority, measure_jitter
from robot.port.usb import Diagnosis, check_port, find_port, list_ports

LISTEN_S = 0.5
SILENT_S = 0.5  # a base that has power sends 50 frames a second
WATCHDOG_S, PRESS_S = 3.0, 20.0
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


def try_computer() -> Iterator[Diagnosis]:
    """Yield how late this computer lets a program go on."""
    worst_s = measure_jitter(time.monotonic, time.sleep)
    yield Diagnosis(
        f"A pause of 20 ms took up to {1000 * worst_s:.0f} ms longer; the port's process runs with "
        f"{find_priority()} priority.",
        explain_jitter(worst_s),
    )


def list_plugins() -> Iterator[Diagnosis]:
    """Yield the bases and gestures of other packages, and why one of them cannot be used."""
    for plugin in (*BASES.plugins, *GESTURES.plugins):
        what = f"{plugin.name} of {plugin.package} {plugin.version}"
        cure = f"pip install --upgrade {plugin.package}" if plugin.problem else ""
        yield Diagnosis(f"{what}: {plugin.problem or 'in use'}.", cure)


def try_cut(port: str) -> Iterator[Diagnosis]:
    """Yield whether a watchdog, or else a person's emergency stop, takes the base's power."""
    try:
        line = PortOpener(port, BAUD)()
    except (OSError, ValueError) as problem:
        yield Diagnosis(f"{port} cannot be opened: {problem}", _cure_opening(str(problem)))
        return
    try:
        line.write(STOP_FRAME)
        silent_after_s = _until_silent(line, WATCHDOG_S)
        if silent_after_s is not None:
            yield Diagnosis(
                f"A watchdog took its power after {silent_after_s:.1f} s without orders."
            )
            return
        yield Diagnosis("No watchdog takes its power. Press the emergency stop now.")
        pressed_s = _until_silent(line, PRESS_S)
    finally:
        line.close()
    if pressed_s is None:
        yield Diagnosis(
            "Nothing took its power.", "Add a hardware cut (docs/safety.md) before it drives."
        )
    else:
        yield Diagnosis("The emergency stop took its power.")


def _until_silent(line: SerialPort, within_s: float) -> float | None:
    """Return when it last said anything [s]; None where it never fell silent."""
    began_s = heard_s = time.monotonic()
    while (now_s := time.monotonic()) - began_s < within_s:
        if line.read(4096):
            heard_s = now_s
        elif now_s - heard_s >= SILENT_S:
            return heard_s - began_s
    return None


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
    parser.add_argument("--cut", action="store_true", help="try the hardware cut, wheels up")
    options = parser.parse_args(arguments)
    port = options.port or find_port()
    wrong = 0
    looks = [check_port(port, list_ports()), try_computer(), listen(port), list_plugins()]
    for look in [try_cut(port)] if options.cut else looks:
        for diagnosis in look:
            wrong += bool(diagnosis.cure)
            cure = f"\n      Cure: {diagnosis.cure}" if diagnosis.cure else ""
            sys.stdout.write(f"{'  !!' if cure else '  ok'}  {diagnosis.what}{cure}\n")
            sys.stdout.flush()
    return 1 if wrong else 0
