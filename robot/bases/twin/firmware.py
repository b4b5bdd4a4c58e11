"""The firmware of the twin: reads a Kobuki's commands, and sends a Kobuki's feedback."""

from __future__ import annotations

import math
import random
from collections import deque
from typing import NamedTuple

from robot.bases.drive_train import DriveTrain
from robot.bases.kobuki_protocol.commands import (
    BaseControl,
    Command,
    Extra,
    GetGain,
    GpOutput,
    Output,
    RequestExtra,
    SetGain,
    Sound,
    SoundSequence,
    decode_commands,
)
from robot.bases.kobuki_protocol.feedback import (
    CliffRaw,
    ControllerInfo,
    CoreSensors,
    DockIr,
    Feedback,
    GpInput,
    GyroRaw,
    Inertia,
    MotorCurrent,
    SensorSide,
    Udid,
    Version,
    encode_feedback,
)
from robot.bases.kobuki_protocol.frames import FRAME_S, FrameReader
from robot.bases.kobuki_protocol.wheels import (
    STOP,
    TICK_M,
    WHEEL_MAX_M_S,
    control_to_twist,
    slow_to_wheels,
)
from robot.bases.twin.bodies import WheeledBody
from robot.bases.twin.faults import Faults

# The newest firmware there is, and the common hardware (docs/reference/kobuki.md#firmware).
FIRMWARE = Version(1, 2, 0)
HARDWARE = Version(1, 0, 4)
LONG_VERSIONS = Version(1, 1, 2)  # from here on in four bytes
GAINS = Version(1, 2, 0)  # from here on they can be set and requested
UDID = Udid(0x47415252, 0x59, 0x5457494E)

# Floor that is further away than this is a cliff
# (docs/reference/kobuki.md#bumps-cliffs-wheel-drops).
CLIFF_M = 0.05
GYRO_MAX_DEG_S = 250.0  # (docs/reference/kobuki.md#odometry-and-gyro)
GYRO_DIGIT_DEG_S = 0.00875  # (docs/reference/kobuki.md#feedback)
# A wheel draws 3 A, where the motor is switched off, at its largest torque; in 10 mA
# (docs/reference/kobuki.md#watchdogs). That it grows in proportion is our own.
CURRENT_N_M = 300.0
WHEEL_M = 0.035  # radius (docs/reference/kobuki.md#twin)
ORDERS_KEPT = 1024
NO_DOCK, NO_INPUT = DockIr(), GpInput()


class ReceivedOrder(NamedTuple):
    """A setpoint that came in, and when [s]."""

    at_s: float
    control: BaseControl


class Firmware:
    """One base that is switched on.

    Parameters
    ----------
    body
        What it moves.
    faults
        What is wrong with it now.
    version
        The version that it reports: before 1.1.2 in two bytes; before 1.2.0 there are no gains.
    watchdog_s
        After so long without a setpoint it stops. None, as a real one, for which no watchdog is
        documented (docs/reference/kobuki.md#watchdogs).
    chance
        Of the line's faults.

    Attributes
    ----------
    orders
        The latest setpoints that came in.
    output
        The word of its outputs; all power rails are on at first.
    sounds
        How many sounds were requested.
    reader
        Counts what came in damaged.
    """

    def __init__(
        self,
        body: WheeledBody,
        faults: Faults,
        version: Version = FIRMWARE,
        watchdog_s: float | None = None,
        *,
        chance: random.Random,
    ) -> None:
        self.body, self.faults, self.version = body, faults, version
        self.watchdog_s = watchdog_s
        self.orders: deque[ReceivedOrder] = deque(maxlen=ORDERS_KEPT)
        self._chance = chance
        self.switch_on()

    def switch_on(self) -> None:
        """Start as after its power was off: all counters at 0, standing still."""
        self.reader = FrameReader(decode_commands)
        self.drive_train = DriveTrain()
        self.control, self._ordered_s = STOP, -math.inf
        self.output, self.sounds = int(Output.POWER), 0
        self._frames = 0
        self._gains = ControllerInfo()
        self._requested: set[str] = set()
        self._rolled_was_m = self.body.rolled_m
        self._counted = [0.0, 0.0]  # ticks, with what is not yet a whole one
        self._heading_from_rad = self.body.pose.heading_rad
        self._drifted_deg = 0.0

    def receive(self, data: bytes, now_s: float) -> None:
        """Carry out the driver's commands.

        Parameters
        ----------
        data
            Bytes as they were sent; the line's faults damage them first.
        now_s
            When they come in [s].
        """
        for commands in self.reader.feed(self.faults.damage(data, self._chance)):
            for command in commands:
                self._execute(command, now_s)

    def step(self, now_s: float) -> bytes:
        """Simulate one frame's time, and return the frame as it arrives at the driver."""
        if self.watchdog_s is not None and now_s - self._ordered_s > self.watchdog_s:
            self._order(STOP, now_s)
        faults, train = self.faults, self.drive_train
        train.dead_time_s, train.lag_s = faults.dead_time_s, faults.lag_s
        train.stiction_m_s, train.held = faults.stiction_m_s, faults.held
        left_m_s, right_m_s = train.step(now_s, FRAME_S)
        self.body.roll(left_m_s * faults.left_scale, right_m_s * faults.right_scale)
        self._count(faults.left_scale, faults.right_scale)
        self._frames += 1
        self._drifted_deg += faults.drift_deg_min / 60 * FRAME_S
        short = self.version < LONG_VERSIONS
        frame = encode_feedback(self._feedback(left_m_s, right_m_s), short_versions=short)
        return faults.damage(frame, self._chance)

    def _order(self, control: BaseControl, now_s: float) -> None:
        self.control = control
        self.drive_train.order(slow_to_wheels(control_to_twist(control)).wheels_m_s, now_s)

    def carry_home(self) -> None:
        """Carry the body to where it began, unnoticed by the gyro."""
        turned_rad = self.body.pose.heading_rad - self._heading_from_rad
        self.body.carry_home()
        self._heading_from_rad = self.body.pose.heading_rad - turned_rad

    def _execute(self, command: Command, now_s: float) -> None:
        match command:
            case BaseControl():
                self._ordered_s = now_s
                self._order(command, now_s)
                self.orders.append(ReceivedOrder(now_s, command))
            case RequestExtra(flags):
                names = {"hardware": Extra.HARDWARE, "firmware": Extra.FIRMWARE, "udid": Extra.UDID}
                self._requested |= {name for name, flag in names.items() if flags & flag}
            case GpOutput(word):
                self.output = word
            case SetGain(kind, p, i, d) if self.version >= GAINS:
                self._gains = ControllerInfo(kind, p, i, d)
            case GetGain() if self.version >= GAINS:
                self._requested.add("controller")
            case Sound() | SoundSequence():
                self.sounds += 1

    def _feedback(self, left_m_s: float, right_m_s: float) -> Feedback:
        faults, touch, number = self.faults, self.body.touch(), self._frames
        turned_deg = math.degrees(self.body.pose.heading_rad - self._heading_from_rad)
        rate_deg_s = math.degrees(self.body.turn_rad_s) + faults.drift_deg_min / 60
        rate_deg_s += self._chance.gauss(0.0, 1.0) * faults.gyro_noise_deg_s
        rate_deg_s = max(-GYRO_MAX_DEG_S, min(GYRO_MAX_DEG_S, rate_deg_s))
        angle = math.remainder(100 * (turned_deg + self._drifted_deg), 36_000)
        # The body does not know what holds a wheel.
        held_n_m = self.drive_train.force_n * WHEEL_M / 2
        left_n_m, right_n_m = (max(abs(torque), held_n_m) for torque in touch.torque_n_m)
        sample = (0, 0, round(rate_deg_s / GYRO_DIGIT_DEG_S))
        requested, self._requested = self._requested, set()
        return Feedback(
            core=CoreSensors(
                time_ms=number * round(1000 * FRAME_S) % 65536,
                bumper=touch.bumper | faults.bumper,
                wheel_drop=touch.wheel_drop | faults.wheel_drop,
                cliff=_cliff(touch.floor_m) | faults.cliff,
                left_ticks=round(self._counted[0]) % 65536,
                right_ticks=round(self._counted[1]) % 65536,
                left_pwm=round(127 * left_m_s / WHEEL_MAX_M_S),
                right_pwm=round(127 * right_m_s / WHEEL_MAX_M_S),
                buttons=faults.buttons,
                charger=faults.charger,
                battery=round(10 * faults.battery_v),
                over_current=faults.over_current,
            ),
            dock=NO_DOCK,
            inertia=Inertia(round(angle), round(100 * rate_deg_s)),
            cliff=CliffRaw(*map(_voltage, touch.floor_m)),
            current=MotorCurrent(_current(left_n_m), _current(right_n_m)),
            # A sensor of 100 Hz on a link of 50: two samples, or three
            # (docs/reference/kobuki.md#feedback).
            gyro=GyroRaw((5 * number - 4) // 2 % 256, (sample,) * (2 + number % 2)),
            gp=NO_INPUT,
            hardware=HARDWARE if "hardware" in requested else None,
            firmware=self.version if "firmware" in requested else None,
            udid=UDID if "udid" in requested else None,
            controller=self._gains if "controller" in requested else None,
        )

    def _count(self, *scales: float) -> None:
        """Advance the encoders. A wheel that is larger than assumed counts less for a distance."""
        now_m, was_m = self.body.rolled_m, self._rolled_was_m
        for wheel, scale in enumerate(scales):
            self._counted[wheel] += (now_m[wheel] - was_m[wheel]) / scale / TICK_M
        self._rolled_was_m = now_m


def _cliff(floor_m: tuple[float, float, float]) -> int:
    sides = (SensorSide.RIGHT, SensorSide.CENTER, SensorSide.LEFT)
    return sum(side for side, away_m in zip(sides, floor_m, strict=True) if away_m > CLIFF_M)


def _voltage(away_m: float) -> int:
    """Return a floor sensor's reading, which falls with distance; the curve is ours."""
    return min(4095, round(0.056 / (away_m + 0.005) / 3.3 * 4095))


def _current(torque_n_m: float) -> int:
    return min(255, round(CURRENT_N_M * abs(torque_n_m)))
