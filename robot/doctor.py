"""`python -m robot doctor`: finds a Kobuki's port, and says what is wrong with it.

It tries the camera, too, by which a base of this computer finds home (docs/robot.md).
With --cut it tries the hardware cut (docs/safety.md), with the wheels off the floor: it sends
nothing for some seconds, then asks for the emergency stop to be pressed, and says whether the base
lost its power.
"""

from __future__ import annotations

import sys
import time
from argparse import ArgumentParser
from collections.abc import Iterator, Sequence
from importlib.util import find_spec

from robot.bases import BASES
from robot.bases.kobuki import STOP_FRAME, KobukiBase
from robot.bases.kobuki_protocol.frames import BAUD
from robot.behavior.safety import BASE_SILENT_S, BATTERY_LOW_V, BATTERY_WARN_V
from robot.calibration import BadCalibration, home_views
from robot.homing.camera_supervisor import CameraEye
from robot.homing.codes import CAMERA_SILENT, CAMERA_SLOW, NO_TAG
from robot.homing.codes import CURES as CAMERA_CURES
from robot.homing.home_view import HomeView
from robot.motion.gestures import GESTURES
from robot.port.opening import PortOpener
from robot.port.owner import SerialPort
from robot.port.priority import explain_jitter, find_priority, measure_jitter
from robot.port.usb import Diagnosis, check_port, find_port, list_ports

LISTEN_S = 0.5
SILENT_S = 0.5  # a base that has power sends 50 frames a second
WATCHDOG_S, PRESS_S = 3.0, 20.0
FRAMES_PER_S = 45.0  # a base sends 50; some may be lost
CAMERA_S, CAMERA_FRAMES = 12.0, 30  # a camera may take some seconds to start
CAMERA_PER_S = 4.0  # a look takes eight within 2.5 s (robot/homing/still_frames.py)

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


def try_cameras() -> Iterator[Diagnosis]:
    """Yield what the cameras see by which bases find home."""
    try:
        views = home_views()
    except BadCalibration as problem:
        yield Diagnosis("How home is seen:", str(problem))
        return
    if views and find_spec("cv2") is None:
        yield Diagnosis("A base has learned to find home by a tag.", "pip install 'garry[tag]'")
        return
    for view in views:
        yield try_camera(view)


def try_camera(view: HomeView) -> Diagnosis:
    """Return what a camera sees within some seconds."""
    what, seen, frames, began_s = f"Camera {view.camera}", set[int](), 0, time.monotonic()
    first_s = problem = None
    with CameraEye(view.camera) as eye:
        while (now_s := time.monotonic()) - began_s < CAMERA_S and frames < CAMERA_FRAMES:
            eye.watch(now_s)
            for sighting in eye.take():
                problem = sighting.problem
                first_s = sighting.at_s if first_s is None else first_s
                frames += 1
                seen |= {number for number, _ in sighting.tags}
            time.sleep(0.02)
    if problem or first_s is None:
        problem = problem or CAMERA_SILENT
        return Diagnosis(f"{what}: {problem}.", CAMERA_CURES[problem])
    per_s = (frames - 1) / max(now_s - first_s, 1e-3)
    tags = ", ".join(map(str, sorted(seen))) or "none"
    text = f"{what}: {per_s:.0f} frames a second; tags: {tags}; home is by tag {view.tag}."
    problem = CAMERA_SLOW if per_s < CAMERA_PER_S else "" if view.tag in seen else NO_TAG
    return Diagnosis(text, CAMERA_CURES[problem] if problem else "")


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
            "Nothing took its power.", "Add a hardware cut (/help/safety/) before it drives."
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
    for look in [try_cut(port)] if options.cut else [*looks, try_cameras()]:
        for diagnosis in look:
            wrong += bool(diagnosis.cure)
            cure = f"\n      Cure: {diagnosis.cure}" if diagnosis.cure else ""
            sys.stdout.write(f"{'  !!' if cure else '  ok'}  {diagnosis.what}{cure}\n")
            sys.stdout.flush()
    return 1 if wrong else 0
