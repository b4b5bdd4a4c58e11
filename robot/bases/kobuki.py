"""A Kobuki on a serial port, driven by way of the process that owns the port."""

from __future__ import annotations

import threading
import time
from collections import Counter
from collections.abc import Callable, Mapping
from types import TracebackType
from typing import ClassVar, Self

from robot.bases.base import Abilities, BaseLost, BaseState, MobileBase, Mood, Senses
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
from robot.bases.kobuki_protocol.frames import BAUD, FrameReader
from robot.bases.kobuki_protocol.trust import Sighting, Trust
from robot.bases.kobuki_protocol.wheels import STOP, WHEELBASE_M, control_of, twist_of
from robot.motion import CEILING_M_S, CEILING_RAD_S, STILL, Limits, Twist
from robot.odometry import Odometry
from robot.port_client import Heard, PortClient
from robot.usb import find_port

WHEELS = Limits(v_m_s=CEILING_M_S, w_rad_s=CEILING_RAD_S)
STOP_FRAME = encode_commands(STOP)

FIRMWARE_MAJOR = 1  # what the reference driver takes (docs/reference/kobuki.md#firmware)
ASK_EVERY_S = 0.1  # for the versions, until they are known
LIGHT_EVERY_S = 1.0  # lights again, for a base that was switched off meanwhile
# A hazard counts for so long [s] after it was felt last: no look in between misses it.
FELT_S = 0.1
GREETING_S = 1.5  # a base that is switched on has told all by then

LIGHTS = {
    Mood.WAITING: Output(0),
    Mood.READY: Output.LED1_GREEN,
    Mood.MOVING: Output.LED1_ORANGE,
    Mood.STOPPED: Output.LED1_RED,
}
SOUNDS = {Mood.MOVING: Melody.BUTTON, Mood.STOPPED: Melody.ERROR}


class KobukiBase(MobileBase):
    """Orders a Kobuki and adds up where it is. A port that is lost is opened again for ever."""

    name: ClassVar[str] = "kobuki"
    abilities = Abilities(simulated=False, moves=True, announces=True, real_time=True, bumpers=True)

    def __init__(self, monotonic: Callable[[], float]) -> None:
        self._monotonic = monotonic
        self._client: PortClient | None = None
        self._lock = threading.Lock()  # what is heard comes on another thread
        self._reader = FrameReader(decode_feedback)
        self._trust = Trust()
        self._odometry = Odometry(WHEELBASE_M)
        self._sighting: Sighting | None = None
        self._opened = 0
        self._seen_s = self._begun_s = monotonic()
        self._felt: dict[str, float] = {}
        self._mood, self._sound = Mood.WAITING, b""
        self._asked_s = self._lit_s = monotonic() - LIGHT_EVERY_S

    def __enter__(self) -> Self:
        """Open the port, stop what hangs on it, and give it a moment to say what it is."""
        self._client = PortClient(
            self.port or find_port(), BAUD, STOP_FRAME, self._hear, self._monotonic
        )
        until_s = self._monotonic() + GREETING_S
        while self._monotonic() < until_s and not self._client.is_dead:
            self.stop()
            with self._lock:
                if self._sighting is not None and self._trust.firmware is not None:
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
        self.show(Mood.WAITING, aloud=False)
        self.stop()
        if self._client is not None:
            self._client.close()

    @property
    def counters(self) -> Mapping[str, int]:
        """Count what came in damaged and what the port's process did not send."""
        with self._lock:
            reader = self._reader
            counts = Counter(
                bad_checksums=reader.bad_checksums,
                malformed=reader.malformed,
                skipped_bytes=reader.skipped_bytes,
                doubted=self._trust.doubted,
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
        return "" if self._trust.firmware is None else str(self._trust.firmware)

    @property
    def problem(self) -> str:
        """Say why the port is not open; empty where it is."""
        return "" if self._client is None else self._client.problem

    def drive(self, twist: Twist) -> Twist:
        """Order a velocity; its speeds are clipped."""
        if self._client is None or self._client.is_dead:
            raise BaseLost("The process that owns the port does not run: see its words above.")
        control = control_of(WHEELS.clip(twist))
        self._client.order(encode_commands(control), self._asides())
        return twist_of(control)

    def stop(self) -> None:
        """Stand still at once."""
        if self._client is not None:
            self._client.order(STOP_FRAME, self._asides())

    def read(self) -> BaseState:
        """Give what is believed of it now."""
        if self._client is None or self._client.is_dead:
            raise BaseLost("The process that owns the port does not run: see its words above.")
        now_s = self._monotonic()
        with self._lock:
            sighting, odometry = self._sighting, self._odometry
            felt = {name for name, felt_s in self._felt.items() if now_s - felt_s <= FELT_S}
            silent_s, firmware = now_s - self._seen_s, self._trust.firmware
            if sighting is None:
                return BaseState(odometry.pose, STILL, Senses(silent_s=max(silent_s, GREETING_S)))
            refusal = "firmware_unknown" if firmware is None else ""
            if firmware is not None and firmware.major != FIRMWARE_MAJOR:
                refusal = "firmware_refused"
            senses = Senses(
                hazards=frozenset(felt - {"stop_button"}),
                refusal=refusal,
                stop_pressed="stop_button" in felt,
                battery_v=sighting.battery_v if sighting.battery_v > 0 else None,
                is_charging=sighting.is_charging,
                silent_s=silent_s,
                slip_rad=odometry.slip_rad,
            )
            twist = Twist((sighting.left_m_s + sighting.right_m_s) / 2, sighting.turn_rad_s)
            return BaseState(odometry.pose, twist, senses)

    def set_home(self) -> None:
        """Begin odometry anew: this place is home."""
        with self._lock:
            self._odometry.set_home()

    def show(self, mood: Mood, *, aloud: bool) -> None:
        """Show it by the first light, and by a short sound."""
        self._mood, self._lit_s = mood, self._monotonic() - LIGHT_EVERY_S
        if aloud and mood in SOUNDS:
            self._sound = encode_commands(SoundSequence(SOUNDS[mood]))

    def _asides(self) -> bytes:
        """Give what is to be sent beside the next setpoint. External power stays on."""
        now_s = self._monotonic()
        asides, self._sound = self._sound, b""
        if now_s - self._lit_s >= LIGHT_EVERY_S:
            self._lit_s = now_s
            asides += encode_commands(GpOutput(Output.POWER | LIGHTS[self._mood]))
        if self._trust.firmware is None and now_s - self._asked_s >= ASK_EVERY_S:
            self._asked_s = now_s
            asides += encode_commands(RequestExtra(Extra.HARDWARE | Extra.FIRMWARE | Extra.UDID))
        return asides

    def _hear(self, heard: Heard) -> None:
        """Take bytes of the base, on the client's thread."""
        with self._lock:
            if heard.opened != self._opened:
                self._opened = heard.opened
                self._trust.forget()
            for feedback in self._reader.feed(heard.data):
                sighting = self._trust.take(feedback, heard.at_s)
                if sighting is not None:
                    self._see(sighting, heard.at_s)

    def _see(self, sighting: Sighting, at_s: float) -> None:
        anew = sighting.began_anew and self._sighting is not None
        self._sighting, self._seen_s = sighting, at_s
        self._odometry.add(
            sighting.left_m, sighting.right_m, sighting.heading_rad, sighting.turn_rad_s
        )
        felt = {
            "bump": sighting.bumper,
            "cliff": sighting.cliff,
            "wheel_drop": sighting.wheel_drop,
            "over_current": sighting.over_current,
            "restarted": anew,  # switched off, or carried away: where home is nobody knows
            "stop_button": sighting.buttons & Button.B0,
        }
        self._felt |= {name: at_s for name, is_felt in felt.items() if is_felt}
