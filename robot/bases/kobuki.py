"""A Kobuki on a serial port, driven through the process that owns the port."""

from __future__ import annotations

import threading
import time
from collections import Counter
from collections.abc import Callable, Mapping
from types import TracebackType
from typing import ClassVar, Self

from robot.bases.base import Abilities, BaseLost, BaseState, Indication, MobileBase, SensorState
from robot.bases.kobuki_protocol.commands import (
    Extra,
    GpOutput,
    Melody,
    Output,
    RequestExtra,
    SoundSequence,
    encode_commands,
)
from robot.bases.kobuki_protocol.feedback import Button, decode_feedback
from robot.bases.kobuki_protocol.frame_filter import Estimate, FrameFilter
from robot.bases.kobuki_protocol.frames import BAUD, FrameReader
from robot.bases.kobuki_protocol.wheels import STOP, WHEELBASE_M, control_to_twist, twist_to_control
from robot.motion.limits import CEILING_M_S, CEILING_RAD_S, Limits
from robot.motion.odometry import Odometry
from robot.motion.twist import STILL, Twist
from robot.port.client import PortClient, ReceivedBytes
from robot.port.usb import find_port

WHEEL_LIMITS = Limits(v_m_s=CEILING_M_S, w_rad_s=CEILING_RAD_S)
STOP_FRAME = encode_commands(STOP)

FIRMWARE_MAJOR = 1  # what the reference driver takes (docs/reference/kobuki.md#firmware)
REQUEST_EVERY_S = 0.1  # for the versions, until they are known
LIGHT_EVERY_S = 1.0  # lights again, for a base that was switched off meanwhile
# A hazard counts for this long [s] after it was last detected, so that no tick misses it.
HAZARD_HOLD_S = 0.1
GREETING_S = 1.5  # a base that is switched on has reported everything by then

LIGHTS = {
    Indication.WAITING: Output(0),
    Indication.READY: Output.LED1_GREEN,
    Indication.MOVING: Output.LED1_ORANGE,
    Indication.STOPPED: Output.LED1_RED,
}
SOUNDS = {Indication.MOVING: Melody.BUTTON, Indication.STOPPED: Melody.ERROR}


class KobukiBase(MobileBase):
    """Drives a Kobuki and integrates its odometry. A lost port is reopened forever."""

    name: ClassVar[str] = "kobuki"
    abilities = Abilities(simulated=False, moves=True, announces=True, real_time=True, bumpers=True)

    def __init__(self, monotonic: Callable[[], float]) -> None:
        self._monotonic = monotonic
        self._client: PortClient | None = None
        self._lock = threading.Lock()  # data are received on another thread
        self._reader = FrameReader(decode_feedback)
        self._filter = FrameFilter()
        self._odometry = Odometry(WHEELBASE_M)
        self._estimate: Estimate | None = None
        self._opened = 0
        self._seen_s = self._begun_s = monotonic()
        self._detected_s: dict[str, float] = {}
        self._indication, self._sound = Indication.WAITING, b""
        self._requested_s = self._lit_s = monotonic() - LIGHT_EVERY_S

    def __enter__(self) -> Self:
        """Open the port, stop the base, and wait a moment for its firmware version."""
        self._client = PortClient(
            self.port or find_port(), BAUD, STOP_FRAME, self._receive, self._monotonic
        )
        until_s = self._monotonic() + GREETING_S
        while self._monotonic() < until_s and not self._client.is_dead:
            self.stop()
            with self._lock:
                if self._estimate is not None and self._filter.firmware is not None:
                    break
            time.sleep(0.02)
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        problem: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        """Leave it standing still, its lights off."""
        self.show(Indication.WAITING, aloud=False)
        self.stop()
        if self._client is not None:
            self._client.close()

    @property
    def counters(self) -> Mapping[str, int]:
        """How many frames came in damaged, and how many the port's process did not send."""
        with self._lock:
            reader = self._reader
            counts = Counter(
                bad_checksums=reader.bad_checksums,
                malformed=reader.malformed,
                skipped_bytes=reader.skipped_bytes,
                doubted=self._filter.doubted,
            )
        if self._client is not None:
            counts.update({f"port_{name}": n for name, n in self._client.count().items()})
        return counts

    @property
    def frames(self) -> int:
        """How many frames of it have come in whole."""
        return self._reader.frames

    @property
    def firmware(self) -> str:
        """Version of its firmware; empty until it is known."""
        return "" if self._filter.firmware is None else str(self._filter.firmware)

    @property
    def problem(self) -> str:
        """Why the port is not open; empty where it is."""
        return "" if self._client is None else self._client.problem

    def drive(self, twist: Twist) -> Twist:
        """Order a velocity; its speeds are clipped."""
        if self._client is None or self._client.is_dead:
            raise BaseLost("The process that owns the port does not run: see its messages above.")
        control = twist_to_control(WHEEL_LIMITS.clip(twist))
        self._client.order(encode_commands(control), self._extra_commands())
        return control_to_twist(control)

    def stop(self) -> None:
        """Stand still at once."""
        if self._client is not None:
            self._client.order(STOP_FRAME, self._extra_commands())

    def read(self) -> BaseState:
        """Return its state now. Raises BaseLost."""
        if self._client is None or self._client.is_dead:
            raise BaseLost("The process that owns the port does not run: see its messages above.")
        now_s = self._monotonic()
        with self._lock:
            estimate, odometry = self._estimate, self._odometry
            detected = {
                name for name, at_s in self._detected_s.items() if now_s - at_s <= HAZARD_HOLD_S
            }
            silent_s, firmware = now_s - self._seen_s, self._filter.firmware
            if estimate is None:
                return BaseState(
                    odometry.pose, STILL, SensorState(silent_s=max(silent_s, GREETING_S))
                )
            refusal = "firmware_unknown" if firmware is None else ""
            if firmware is not None and firmware.major != FIRMWARE_MAJOR:
                refusal = "firmware_refused"
            sensors = SensorState(
                hazards=frozenset(detected - {"stop_button"}),
                refusal=refusal,
                stop_pressed="stop_button" in detected,
                battery_v=estimate.battery_v if estimate.battery_v > 0 else None,
                is_charging=estimate.is_charging,
                silent_s=silent_s,
                slip_rad=odometry.slip_rad,
            )
            twist = Twist((estimate.left_m_s + estimate.right_m_s) / 2, estimate.turn_rad_s)
            return BaseState(odometry.pose, twist, sensors)

    def set_home(self) -> None:
        """Make this place home."""
        with self._lock:
            self._odometry.set_home()

    def show(self, indication: Indication, *, aloud: bool) -> None:
        """Show its state by the first light, and by a short sound."""
        self._indication, self._lit_s = indication, self._monotonic() - LIGHT_EVERY_S
        if aloud and indication in SOUNDS:
            self._sound = encode_commands(SoundSequence(SOUNDS[indication]))

    def _extra_commands(self) -> bytes:
        """Return commands to send beside the next setpoint. External power stays on."""
        now_s = self._monotonic()
        extra, self._sound = self._sound, b""
        if now_s - self._lit_s >= LIGHT_EVERY_S:
            self._lit_s = now_s
            extra += encode_commands(GpOutput(Output.POWER | LIGHTS[self._indication]))
        if self._filter.firmware is None and now_s - self._requested_s >= REQUEST_EVERY_S:
            self._requested_s = now_s
            extra += encode_commands(RequestExtra(Extra.HARDWARE | Extra.FIRMWARE | Extra.UDID))
        return extra

    def _receive(self, received: ReceivedBytes) -> None:
        """Handle bytes of the base, on the client's thread."""
        with self._lock:
            if received.opened != self._opened:
                self._opened = received.opened
                self._filter.reset()
            for feedback in self._reader.feed(received.data):
                estimate = self._filter.update(feedback, received.at_s)
                if estimate is not None:
                    self._update(estimate, received.at_s)

    def _update(self, estimate: Estimate, at_s: float) -> None:
        has_restarted = estimate.restarted and self._estimate is not None
        self._estimate, self._seen_s = estimate, at_s
        self._odometry.add(
            estimate.left_m, estimate.right_m, estimate.heading_rad, estimate.turn_rad_s
        )
        detected = {
            "bump": estimate.bumper,
            "cliff": estimate.cliff,
            "wheel_drop": estimate.wheel_drop,
            "over_current": estimate.over_current,
            "restarted": has_restarted,  # switched off or carried away: home is unknown
            "stop_button": estimate.buttons & Button.B0,
        }
        self._detected_s |= {name: at_s for name, is_felt in detected.items() if is_felt}
