"""A Kobuki of bytes that shares no mistake with ours.

It is written from the tables of docs/reference/kobuki.md#framing alone.

It notes every setpoint with its time, and rolls its wheels as the firmware would.
"""

from __future__ import annotations

import math
import os
import socket
import struct
import threading
import time
from contextlib import suppress
from typing import Self

STOP_FRAME = bytes.fromhex("AA550601040000000003")
FORWARD_200 = bytes.fromhex("AA55060104C8000000CB")
TICK_M = 8.5292090497737556558e-5


STANDS_M_S = 0.002


def _speeds(speed, radius):
    """Return the speeds of an order: ahead [m/s] and turning [rad/s]."""
    speed_m_s, radius_m = speed / 1000, radius / 1000
    if radius == 0:
        return speed_m_s, 0.0
    if radius == 1:
        return 0.0, speed_m_s / 0.115
    w = speed_m_s / (radius_m + math.copysign(0.115, radius_m))
    return w * radius_m, w


def frame(payload):
    checksum = 0
    for byte in bytes([len(payload)]) + payload:
        checksum ^= byte
    return b"\xaa\x55" + bytes([len(payload)]) + payload + bytes([checksum])


class FakeKobuki:
    """Runs on a thread until closed. ``orders`` has (monotonic time, speed, radius).

    What it feels (``bumper`` to ``battery``) goes into its frames as it is; ``is_mute`` keeps it
    from saying anything, ``is_flooded`` from reading, ``is_held`` its wheels from rolling, and
    ``is_driven`` rolls them by somebody else's order. Where it really is from where it began:
    ``x_m``, ``y_m`` and ``heading_rad``. Its wheels follow after ``dead_s``, with a lag of
    ``lag_s``; ``rolled`` has the times at which they turned. ``frames`` were sent.
    """

    def __init__(self, over="pty", version=(1, 2, 0), dead_s=0.0, lag_s=0.0):
        self.over, self.version = over, version
        self.dead_s, self.lag_s = dead_s, lag_s
        self.rolled: list[float] = []
        self.frames = 0
        self._followed, self._v, self._w = 0, 0.0, 0.0
        self.bumper = self.cliff = self.wheel_drop = self.over_current = 0
        self.buttons, self.charger, self.battery = 0, 0, 160
        self.is_mute = self.is_held = self.is_flooded = self.is_driven = False
        self.orders, self.outputs, self.melodies, self.notes, self.bad = [], [], [], [], 0
        self.noise = b""  # to be sent before the next frame
        self._asked = 0
        self._left = self._right = 65000.0  # ticks; they wrap soon
        self._angle_deg, self._rate_deg_s = 179.0, 0.0
        self.x_m = self.y_m = self.heading_rad = 0.0
        self._speed, self._radius = 0, 0
        self._booted_s = time.monotonic() - 60.0
        self._ends, self._buffer = threading.Event(), b""
        self._io = self._slave = self._listener = None
        if over == "pty":
            self._open_pty()
        else:
            self._listener = socket.create_server(("127.0.0.1", 0))
            self._listener.setblocking(False)
            self.url = f"socket://127.0.0.1:{self._listener.getsockname()[1]}"
        self._thread = threading.Thread(target=self._run, daemon=True)
        self._thread.start()

    def _open_pty(self):
        import tty

        master, self._slave = os.openpty()
        tty.setraw(self._slave)
        os.set_blocking(master, False)
        self._io = master
        self.url = os.ttyname(self._slave)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_):
        self._ends.set()
        self._thread.join(5)
        self.unplug()
        if self._listener is not None:
            self._listener.close()

    def unplug(self):
        """Let the port vanish."""
        if isinstance(self._io, socket.socket):
            self._io.close()
        elif self._io is not None:
            os.close(self._io)
            os.close(self._slave)
        self._io = None

    def restart(self):
        """Switch it off and on: its counters and angle begin at 0, its wheels stand."""
        self._left = self._right = 0.0
        self._angle_deg, self._speed = 0.0, 0
        self._followed, self._v, self._w = len(self.orders), 0.0, 0.0
        self._booted_s = time.monotonic()

    @property
    def is_moving(self):
        """Whether its setpoint is any other than zero."""
        return self._speed != 0

    def moved_after(self, since_s: float) -> float:
        """Return how long after a time its setpoint was still other than zero [s]."""
        last, speed = 0.0, 0
        for at_s, now, _ in list(self.orders):
            if speed and at_s > since_s:
                last = at_s - since_s
            speed = now
        return math.inf if speed else last

    def until(self, holds, within_s=10.0):
        """Wait until something holds."""
        end_s = time.monotonic() + within_s
        while not holds():
            assert time.monotonic() < end_s, "it did not come about"
            time.sleep(0.002)

    def _run(self):
        next_s = time.monotonic()
        count = 0
        while not self._ends.is_set():
            now_s = time.monotonic()
            self._hear(now_s)
            if now_s >= next_s:
                next_s = max(next_s + 0.02, now_s - 0.1)
                count += 1
                self._roll(0.02)
                if not self.is_mute:
                    self._send(self.noise + self._feedback(now_s, count))
                    self.frames += 1
                    self.noise = b""
            time.sleep(0.001)

    def _send(self, data):
        with suppress(OSError, ValueError, TypeError):
            if isinstance(self._io, socket.socket):
                self._io.send(data)
            elif self._io is not None:
                os.write(self._io, data)

    def _hear(self, now_s):
        if self._listener is not None:
            with suppress(OSError):
                following, _ = self._listener.accept()
                if self._io is not None:
                    self._io.close()
                self._io = following
                self._io.setblocking(False)
        if self.is_flooded:
            return
        with suppress(OSError, ValueError, TypeError):
            if isinstance(self._io, socket.socket):
                self._buffer += self._io.recv(4096)
            elif self._io is not None:
                self._buffer += os.read(self._io, 4096)
        while len(self._buffer) >= 4:
            start = self._buffer.find(b"\xaa\x55")
            if start:
                self.bad += 1
                self._buffer = self._buffer[start:] if start > 0 else b""
                continue
            length = self._buffer[2]
            if len(self._buffer) < length + 4:
                return
            whole, self._buffer = self._buffer[: length + 4], self._buffer[length + 4 :]
            if frame(whole[3:-1]) != whole:
                self.bad += 1
                continue
            self._obey(whole[3:-1], now_s)

    def _obey(self, payload, now_s):
        while payload:
            kind, length, data = payload[0], payload[1], payload[2 : 2 + payload[1]]
            payload = payload[2 + length :]
            if kind == 1:
                self._speed, self._radius = struct.unpack("<hh", data)
                self.orders.append((now_s, self._speed, self._radius))
            elif kind == 3:
                self.notes.append(struct.unpack("<HB", data))
            elif kind == 4:
                self.melodies.append(data[0])
            elif kind == 9:
                self._asked = struct.unpack("<H", data)[0]
            elif kind == 12:
                self.outputs.append(struct.unpack("<H", data)[0])

    def _roll(self, elapsed_s):
        self._rate_deg_s = 0.0
        now_s = time.monotonic()
        follow_s = now_s - self.dead_s
        while self._followed < len(self.orders) and self.orders[self._followed][0] <= follow_s:
            self._followed += 1
        _, speed, radius = self.orders[self._followed - 1] if self._followed else (0.0, 0, 0)
        v, w = (0.1, 0.0) if self.is_driven else _speeds(speed, radius)
        share = 1 - math.exp(-elapsed_s / self.lag_s) if self.lag_s else 1.0
        self._v += share * (v - self._v)
        self._w += share * (w - self._w)
        v, w = self._v, self._w
        if self.is_held or abs(v) + 0.115 * abs(w) < STANDS_M_S:
            return
        self.rolled.append(now_s)
        self._left += (v - w * 0.115) * elapsed_s / TICK_M
        self._right += (v + w * 0.115) * elapsed_s / TICK_M
        along_rad = self.heading_rad + w * elapsed_s / 2
        self.x_m += v * elapsed_s * math.cos(along_rad)
        self.y_m += v * elapsed_s * math.sin(along_rad)
        self.heading_rad += w * elapsed_s
        self._rate_deg_s = math.degrees(w)
        self._angle_deg += self._rate_deg_s * elapsed_s

    def rolled_after(self, since_s: float) -> float:
        """Return how long after a time its wheels still turned [s]."""
        return max((at_s - since_s for at_s in list(self.rolled) if at_s > since_s), default=0.0)

    def _feedback(self, now_s, count):
        core = struct.pack(
            "<HBBBHHbbBBBB",
            int((now_s - self._booted_s) * 1000) % 65536,
            *(self.bumper, self.wheel_drop, self.cliff),
            *(int(self._left) % 65536, int(self._right) % 65536),
            *(0, 0, self.buttons, self.charger, self.battery, self.over_current),
        )
        angle = round(math.remainder(self._angle_deg, 360) * 100)
        payload = bytes([1, 15]) + core + bytes([3, 3, 0, 0, 0])
        payload += bytes([4, 7]) + struct.pack("<hh3x", angle, round(self._rate_deg_s * 100))
        payload += bytes([5, 6]) + struct.pack("<HHH", 2000, 2000, 2000) + bytes([6, 2, 0, 0])
        samples = 2 + count % 2
        payload += bytes([13, 2 + 6 * samples, count % 256, 3 * samples]) + bytes(6 * samples)
        payload += bytes([16, 16]) + bytes(16)
        if self._asked & 2:
            major, minor, patch = self.version
            payload += bytes([11, 4, patch, minor, major, 0])
        self._asked = 0
        return frame(payload)
