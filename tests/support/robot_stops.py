"""Ways to bring a moving robot to a stop, for tests and benchmarks: name, limit [s], deed."""

from __future__ import annotations

import signal
import time
from collections.abc import Callable

from tests.support.robot_room import Room

LINK_S, WORKER_S, STOP_S = 0.75, 0.35, 0.1  # issue 5, "Must show"


def stop_server(room: Room) -> float:
    """SIGSTOP of the server; then it goes on."""
    took_s = room.still_after(lambda: room.signal_server(signal.SIGSTOP))
    room.signal_server(signal.SIGCONT)
    return took_s


def kill_server(room: Room) -> float:
    """SIGKILL of the server."""
    return room.still_after(lambda: room.signal_server(signal.SIGKILL))


def black_hole(room: Room) -> float:
    """A link that passes nothing on and tells nobody; then it does again."""
    took_s = room.still_after(room.wire.freeze)
    room.wire.thaw()
    return took_s


def stop_worker(room: Room) -> float:
    """SIGSTOP of the worker; then it goes on, and may not take the gesture up again."""
    took_s = room.still_after(lambda: room.worker.send_signal(signal.SIGSTOP))
    room.worker.send_signal(signal.SIGCONT)
    time.sleep(0.5)
    assert not room.kobuki.is_moving
    return took_s


def kill_worker(room: Room) -> float:
    """SIGKILL of the worker; another one takes its place."""
    took_s = room.still_after(room.worker.kill)
    room.worker.communicate()
    room.worker = room.start_worker()
    return took_s


def tap_stop(room: Room) -> float:
    """A stop that is tapped on the PT's page."""
    return room.still_after(lambda: room.page.order("stop"), 0.5)


def bump(room: Room) -> float:
    """A bump; it holds after the bumper is free."""

    def press() -> None:
        room.kobuki.bumper = 2

    took_s = room.still_after(press, 0.5)
    room.kobuki.bumper = 0
    room.until(lambda: room.page.status.get("reason") == "bump")
    room.walk()
    time.sleep(0.8)
    assert not room.kobuki.is_moving
    return took_s


def press_button(room: Room) -> float:
    """The base's own stop button."""

    def press() -> None:
        room.kobuki.buttons = 1

    took_s = room.still_after(press, 0.5)
    room.kobuki.buttons = 0
    room.until(lambda: room.page.status.get("reason") == "button")
    return took_s


STOPS: dict[str, tuple[float, Callable[[Room], float]]] = {
    "SIGSTOP of the server": (LINK_S, stop_server),
    "black-holed link": (LINK_S, black_hole),
    "SIGSTOP of the worker": (WORKER_S, stop_worker),
    "SIGKILL of the worker": (WORKER_S, kill_worker),
    "stop tapped": (STOP_S, tap_stop),
    "bump": (STOP_S, bump),
    "button B0": (STOP_S, press_button),
}
