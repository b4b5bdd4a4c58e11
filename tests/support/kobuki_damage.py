"""Damages a stream of feedback frames, seeded, and tells what came of it."""

from __future__ import annotations

import random
from collections import deque
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field

from robot.bases.kobuki_protocol.feedback import (
    CliffRaw,
    CoreSensors,
    DockIr,
    Feedback,
    GpInput,
    GyroRaw,
    Inertia,
    MotorCurrent,
    SensorSide,
    decode_feedback,
    encode_feedback,
)
from robot.bases.kobuki_protocol.frame_filter import Estimate, FrameFilter
from robot.bases.kobuki_protocol.frames import FRAME_S, FrameReader
from robot.bases.kobuki_protocol.wheels import TICK_M

BUMP_EVERY = 500  # frames; it lasts 50
DRIVE_TICKS = 47  # a frame: 0.2 m/s
LAG = 12  # frames: as long as none may hold, at every second one damaged
ROLL_BOUND_M = 0.12  # the largest speed, for as long as a damaged time stamp may say
TURN_BOUND_RAD = 0.75

Damage = Callable[[bytes, random.Random], bytes]


def is_bumped(number: int) -> bool:
    """Return whether the bumper is pressed in this frame."""
    return number % BUMP_EVERY >= BUMP_EVERY - 50


def drive(number: int, noise: random.Random) -> Feedback:
    """Return the frame of a base that drives straight on at 0.2 m/s, and bumps now and then.

    Its raw gyro is noise, so that AA 55 stands in one frame of a few thousand.
    """
    ticks = DRIVE_TICKS * number % 65536
    sample = [tuple(noise.choice((-21846, 21930, 170, 85, 0)) for _ in range(3)) for _ in "12"]
    return Feedback(
        core=CoreSensors(
            time_ms=20 * number % 65536,
            bumper=SensorSide.CENTER if is_bumped(number) else 0,
            left_ticks=ticks,
            right_ticks=ticks,
        ),
        dock=DockIr(),
        inertia=Inertia(0, 0),
        cliff=CliffRaw(2000, 2000, 2000),
        current=MotorCurrent(10, 10),
        gyro=GyroRaw(2 * number % 256, tuple(sample)),  # type: ignore[arg-type]
        gp=GpInput(),
    )


def lose_bytes(data: bytes, chance: random.Random) -> bytes:
    """Lose each byte with a probability of 1 %."""
    return bytes(byte for byte in data if chance.random() >= 0.01)


def lose_a_byte(data: bytes, chance: random.Random) -> bytes:
    """Lose one byte of every hundredth frame."""
    at = chance.randrange(100 * len(data))
    return data[:at] + data[at + 1 :]


def mutate(data: bytes, chance: random.Random) -> bytes:
    """Damage one frame: bytes lost, doubled, flipped, put in, cut off or a header in the middle."""
    at = chance.randrange(len(data))
    broken = bytearray(data)
    match chance.randrange(7):
        case 0:
            del broken[at]
        case 1:
            broken.insert(at, broken[at])
        case 2:
            broken[at] ^= 1 << chance.randrange(8)
        case 3:  # the same bit twice, which the checksum cannot see
            bit = 1 << chance.randrange(8)
            broken[at] ^= bit
            broken[chance.randrange(len(data))] ^= bit
        case 4:
            broken[at:at] = chance.randbytes(chance.randrange(1, 9))
        case 5:
            del broken[at:]
        case 6:
            broken[at:at] = b"\xaa\x55"
    return bytes(broken)


def keep_share(chance: random.Random, frames: int, damage: Damage) -> float:
    """Return the share of undamaged frames that a reader kept."""
    reader, undamaged, kept = FrameReader(decode_feedback), 0, 0
    waiting: deque[Feedback] = deque(maxlen=8)  # sent whole, not yet heard
    for number in range(frames):
        said = drive(number, chance)
        true = encode_feedback(said)
        sent = damage(true, chance)
        if sent == true:
            undamaged += 1
            waiting.append(said)
        for heard in reader.feed(sent):
            if heard in waiting:
                waiting.remove(heard)
                kept += 1
    return kept / undamaged


@dataclass
class Life:
    """What damage came to."""

    mutated: int = 0
    fooled_checksum: int = 0  # damaged, and taken for a frame
    wrong: list[str] = field(default_factory=list)  # beliefs that were not true


def live_through(chance: random.Random, frames: int) -> Life:
    """Believe a stream of which a third is damaged, and compare it with the truth.

    No two running are damaged: where both were, by the same bit twice in the same two places, the
    second would be believed. (At random halves, that was 22 in a million; all of them stops.)

    A belief is wrong where a bit is raised that was not, or lowered that was not, within the last
    frames; where a button is pressed, a version known, the counters begun anew; or where the wheels
    or the heading are further off than one frame's largest movement.
    """
    life, reader, frame_filter = Life(), FrameReader(decode_feedback), FrameFilter()
    said: deque[Feedback] = deque(maxlen=LAG)
    was_damaged = True
    for number in range(frames):
        said.append(drive(number, chance))
        true = encode_feedback(said[-1])
        spared = was_damaged or number < 3 or chance.random() < 0.5
        sent = true if spared else mutate(true, chance)
        was_damaged = sent != true
        life.mutated += was_damaged
        for heard in reader.feed(sent):
            life.fooled_checksum += heard not in said
            seen = frame_filter.update(heard, number * FRAME_S)
            if seen is not None and number > 2:
                for fault in _faults(seen, frame_filter, number):
                    life.wrong.append(f"frame {number}: {fault} {seen}")
    return life


def _faults(seen: Estimate, frame_filter: FrameFilter, number: int) -> Iterator[str]:
    recent = {is_bumped(max(0, number - back)) for back in range(LAG)}
    if bool(seen.bumper) not in recent:
        yield "bumper"
    if seen.bumper & ~SensorSide.CENTER or seen.cliff or seen.wheel_drop or seen.over_current:
        yield "hazard"
    if seen.buttons or seen.is_charging or frame_filter.firmware:
        yield "button, charger or version"
    if seen.restarted:
        yield "began anew"
    ticks = (DRIVE_TICKS * (number - back) for back in range(LAG))
    if min(abs(seen.left_m - tick * TICK_M) for tick in ticks) > ROLL_BOUND_M:
        yield "wheel"
    if abs(seen.heading_rad) > TURN_BOUND_RAD:
        yield "heading"
