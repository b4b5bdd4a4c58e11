"""A Kobuki on a serial port, driven through the process that owns the port."""

from __future__ import annotations

import threading
import time
from argparse import Namespace
from collections import Counter
from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import ClassVar

from robot.bases.base import (
    Abilities,
    Answer,
    BaseLost,
    BaseState,
    Indication,
    MobileBase,
    SensorState,
)
from robot.bases.face import FaceScreen, read_face
from robot.bases.kobuki_protocol.commands import (
    Extra,
    GpOutput,
    MelodyCode,
    Output,
    RequestExtra,
    Sound,
    SoundSequence,
    encode_commands,
)
from robot.bases.kobuki_protocol.feedback import Button, decode_feedback
from robot.bases.kobuki_protocol.frame_filter import Estimate, FrameFilter
from robot.bases.kobuki_protocol.frames import BAUD, FrameReader
from robot.bases.kobuki_protocol.wheels import STOP, control_to_twist, twist_to_control
from robot.bases.odometry import Odometry
from robot.bases.unordered_motion import UNORDERED, UnorderedMotion
from robot.motion.base_response import Response
from robot.motion.lights_and_sounds import Color, Note
from robot.motion.limits import WHEEL_LIMITS
from robot.motion.pose import HOME
from robot.motion.twist import STILL, Twist
from robot.port.client import PortClient, ReceivedBytes

STOP_FRAME = encode_commands(STOP)

FIRMWARE_MAJOR = 1  # what the reference driver takes (docs/reference/kobuki.md#firmware)
REQUEST_EVERY_S = 0.1  # for the versions, until they are known
LIGHT_EVERY_S = 1.0  # lights again, for a base that was switched off meanwhile
# Force of its motors for their current [N/A]: 1 N·m at 3 A on wheels of 35 mm
# (docs/reference/kobuki.md#twin, #watchdogs); that it grows in proportion is our own.
FORCE_N_A = 1.0 / 3.0 / 0.035
GREETING_S = 1.5  # a base that is switched on has reported everything by then

LIGHTS = {
    Indication.WAITING: Output(0),
    Indication.READY: Output.LED1_GREEN,
    Indication.MOVING: Output.LED1_ORANGE,
    Indication.STOPPED: Output.LED1_RED,
}
SOUNDS = {Indication.STOPPED: MelodyCode.ERROR}
COLORS = {
    Color.OFF: (Output(0), Output(0)),
    Color.GREEN: (Output.LED1_GREEN, Output.LED2_GREEN),
    Color.ORANGE: (Output.LED1_ORANGE, Output.LED2_ORANGE),
}


class KobukiBase(MobileBase):
    """Drives a Kobuki and integrates its odometry. A lost port is reopened forever."""

    name: ClassVar[str] = "kobuki"
    abilities = Abilities(
        simulated=False, moves=True, announces=True, notes=True, real_time=True, bumpers=True
    )

    def __init__(self, monotonic: Callable[[], float]) -> None:
        self._monotonic = monotonic
        self.face: FaceScreen | None = None  # on its mast
        self._client: PortClient | None = None
        self._lock = threading.Lock()  # data are received on another thread
        self._reader = FrameReader(decode_feedback)
        self._filter = FrameFilter()
        self._odometry = Odometry()
        self._estimate: Estimate | None = None
        self._opened = 0
        self._seen_s = monotonic()
        self._unordered = UnorderedMotion()
        self._present = frozenset[str]()  # hazards in the newest frame
        self._unread = frozenset[str]()  # since the last reading, however short
        self._lights, self._sound = LIGHTS[Indication.WAITING], b""
        self._requested_s = self._lit_s = monotonic() - LIGHT_EVERY_S

    def configure(self, options: Namespace) -> None:
        """Apply the port, and the screen's address where it has one. Raises BadOption."""
        super().configure(options)
        if options.face_port is not None:
            self.face = read_face(options, self._monotonic, "face")
            self.abilities = replace(self.abilities, answers=True)

    def answer(self, answer: Answer) -> None:
        """Act by the face on its screen, where it has one."""
        if self.face is not None:
            self.face.answer(answer)

    def open(self) -> None:
        """Open the port, stop the base, and wait a moment for its firmware version."""
        if self.face is not None:
            self.face.open()
        self._client = PortClient(self.port, BAUD, STOP_FRAME, self._receive, self._monotonic)
        until_s = self._monotonic() + GREETING_S
        while self._monotonic() < until_s and not self._client.is_dead:
            self.stop()
            with self._lock:
                if self._estimate is not None and self._filter.firmware is not None:
                    break
            time.sleep(0.02)

    def close(self) -> None:
        """Put its lights off, and close the port."""
        self.show(Indication.WAITING, aloud=False)
        if self.face is not None:
            self.face.close()
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

    @property
    def identity(self) -> str:
        """Its name, and its own number once it has reported that."""
        udid = self._filter.udid
        return self.name if udid is None else f"{self.name}-{udid.a:08x}{udid.b:08x}{udid.c:08x}"

    def calibrate(self, response: Response) -> None:
        """Apply what was measured of its motion. Its present place becomes home."""
        super().calibrate(response)
        with self._lock:
            self._odometry = Odometry(response.gyro_bias_rad_s, response.wheel_scale)

    def drive(self, twist: Twist) -> Twist:
        """Order a velocity; its speeds are clipped."""
        self.abilities.check(twist)
        client = self._running_client()
        if self.face is not None:
            self.face.tick(HOME)  # the base itself moves, not what its screen shows
        control = twist_to_control(WHEEL_LIMITS.clip(twist))
        if control != STOP:
            self._unordered.order_motion(self._monotonic())
        client.order(encode_commands(control), self._extra_commands())
        return control_to_twist(control)

    def stop(self) -> None:
        """Stand still at once."""
        if self._client is not None:
            self._client.order(STOP_FRAME, self._extra_commands())

    def read(self) -> BaseState:
        """Return its state now. Raises BaseLost."""
        self._running_client()
        now_s = self._monotonic()
        with self._lock:
            estimate, odometry = self._estimate, self._odometry
            detected, self._unread = self._unread | self._present, frozenset()
            silent_s, firmware = now_s - self._seen_s, self._filter.firmware
            if estimate is None:
                return BaseState(
                    odometry.pose, STILL, SensorState(silent_s=max(silent_s, GREETING_S))
                )
            refusal = "firmware_unknown" if firmware is None else ""
            if firmware is not None and firmware.major != FIRMWARE_MAJOR:
                refusal = "firmware_refused"
            sensors = SensorState(
                hazards=detected - {"stop_button"},
                refusal=refusal,
                stop_pressed="stop_button" in detected,
                battery_v=estimate.battery_v if estimate.battery_v > 0 else None,
                is_charging=estimate.is_charging,
                silent_s=silent_s,
                slip_rad=odometry.slip_rad,
                doubt_rad=odometry.doubt_rad,
                drift_rad_s=odometry.drift_rad_s,
                push_n=FORCE_N_A * estimate.current_a,
            )
            twist = replace(
                Twist.of_wheels(estimate.left_m_s, estimate.right_m_s), w_rad_s=estimate.turn_rad_s
            )
            return BaseState(odometry.pose, twist, sensors)

    def set_home(self) -> None:
        """Make this place home."""
        with self._lock:
            self._odometry.set_home()

    def show(self, indication: Indication, *, aloud: bool) -> None:
        """Show its state by the first light; ``aloud`` also by a sound, if there is one for it."""
        if self.face is not None:
            self.face.show(indication)
        self._set_lights(LIGHTS[indication])
        if aloud and indication in SOUNDS:
            self._sound = encode_commands(SoundSequence(SOUNDS[indication]))

    def light(self, first: Color, second: Color) -> None:
        """Show colors of a gesture's score, ``first`` and ``second`` of its two lights."""
        self._set_lights(COLORS[first][0] | COLORS[second][1])

    def play(self, note: Note) -> None:
        """Play a note of a gesture's score."""
        if note.melody is not None:
            self._sound = encode_commands(SoundSequence(MelodyCode[note.melody.name]))
        else:
            self._sound = encode_commands(Sound.at(note.frequency_hz, note.duration_s))

    def _running_client(self) -> PortClient:
        if self._client is None or self._client.is_dead:
            raise BaseLost("The process that owns the port does not run: see its messages above.")
        return self._client

    def _set_lights(self, lights: Output) -> None:
        self._lights, self._lit_s = lights, self._monotonic() - LIGHT_EVERY_S

    def _extra_commands(self) -> bytes:
        """Return commands to send beside the next setpoint. External power stays on."""
        now_s = self._monotonic()
        extra, self._sound = self._sound, b""
        if now_s - self._lit_s >= LIGHT_EVERY_S:
            self._lit_s = now_s
            extra += encode_commands(GpOutput(Output.POWER | self._lights))
        if self._filter.firmware is None and now_s - self._requested_s >= REQUEST_EVERY_S:
            self._requested_s = now_s
            extra += encode_commands(RequestExtra(Extra.FIRMWARE | Extra.UDID))
        return extra

    def _receive(self, received: ReceivedBytes) -> None:
        """Handle bytes of the base, on the client's thread."""
        if self.on_bytes is not None and received.data:
            self.on_bytes(received.data)
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
            estimate.left_m, estimate.right_m, estimate.heading_rad, estimate.turn_rad_s, at_s
        )
        detected = {
            "bump": estimate.bumper,
            "cliff": estimate.cliff,
            "wheel_drop": estimate.wheel_drop,
            "over_current": estimate.over_current,
            "restarted": has_restarted,  # switched off or carried away: home is unknown
            "stop_button": estimate.buttons & Button.B0,
            UNORDERED: self._unordered.update(
                max(estimate.left_m_s, estimate.right_m_s, key=abs), at_s
            ),
        }
        self._present = frozenset(hazard for hazard, is_present in detected.items() if is_present)
        self._unread |= self._present
