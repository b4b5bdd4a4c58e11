"""The bytes of a Kobuki: golden frames, both ways, and what damage does to them."""

from __future__ import annotations

import contextlib
import math
import random

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from robot.bases.kobuki_protocol.commands import (
    BaseControl,
    Extra,
    GetGain,
    GpOutput,
    MelodyCode,
    Output,
    RequestExtra,
    SetGain,
    Sound,
    SoundSequence,
    decode_commands,
    encode_commands,
)
from robot.bases.kobuki_protocol.feedback import (
    Button,
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
    decode_feedback,
    encode_feedback,
)
from robot.bases.kobuki_protocol.frames import FrameReader, Malformed, frame
from robot.bases.kobuki_protocol.wheels import (
    STOP,
    WHEEL_MAX_M_S,
    control_to_twist,
    slow_to_wheels,
    twist_to_control,
)
from robot.motion.twist import STILL, WHEELBASE_M, Twist

# --- Golden frames (docs/reference/kobuki.md#commands) --------------------------------------------

GOLDEN = [
    (BaseControl(200, 0), "AA 55 06 01 04 C8 00 00 00 CB"),
    (STOP, "AA 55 06 01 04 00 00 00 00 03"),
    (BaseControl(207, 1), "AA 55 06 01 04 CF 00 01 00 CD"),
    (RequestExtra(Extra.HARDWARE | Extra.FIRMWARE | Extra.UDID), "AA 55 04 09 02 0B 00 04"),
    (SoundSequence(MelodyCode.ON), "AA 55 03 04 01 00 06"),
    (GpOutput(Output.POWER | Output.LED1_GREEN), "AA 55 04 0C 02 F0 02 F8"),
]


@pytest.mark.parametrize(("command", "text"), GOLDEN, ids=[text for _, text in GOLDEN])
def test_golden_commands(command, text):
    sent = bytes.fromhex(text)
    assert encode_commands(command) == sent
    assert FrameReader(decode_commands).feed(sent) == [[command]]


def test_golden_feedback():
    """By hand from the tables, ids 1 and 4: not from our own encoder."""
    sent = bytes.fromhex(
        "AA 55 1A 01 0F 34 12 05 02 02 FF FF 01 00 F6 0A 02 16 A4 01 04 07 50 46 9C FF 00 00 00 0D"
    )
    (said,) = FrameReader(decode_feedback).feed(sent)
    core = said.core
    assert core is not None
    assert (core.time_ms, core.left_ticks, core.right_ticks) == (0x1234, 65535, 1)
    assert core.bumper == SensorSide.RIGHT | SensorSide.LEFT
    assert (core.wheel_drop, core.cliff) == (2, SensorSide.CENTER)
    assert (core.left_pwm, core.right_pwm) == (-10, 10)
    assert core.buttons == Button.B1
    assert core.is_charging
    assert core.battery_v == 16.4
    assert core.over_current == 1
    assert said.inertia == Inertia(18000, -100)
    assert encode_feedback(said) == sent


@pytest.mark.parametrize(("samples", "length"), [(2, 77), (3, 83)])
def test_a_usual_frame_is_as_long_as_a_real_one(samples, length):
    usual = Feedback(
        CoreSensors(0),
        DockIr(),
        Inertia(0, 0),
        CliffRaw(0, 0, 0),
        MotorCurrent(0, 0),
        gyro=GyroRaw(0, ((0, 0, 0),) * samples),
        gp=GpInput(),
    )
    sent = encode_feedback(usual)
    assert sent[:5] == bytes((0xAA, 0x55, length, 0x01, 0x0F))
    assert len(sent) == length + 4


@pytest.mark.parametrize(
    ("text", "version"),
    [
        ("0B 02 7B 00", Version(1, 0, 0)),
        ("0B 02 6E 00", Version(1, 1, 0)),
        ("0B 02 74 27", Version(1, 1, 0)),
        ("0B 02 6F 00", Version(1, 1, 1)),
        ("0B 02 75 27", Version(1, 1, 1)),
        ("0B 04 04 01 01 00", Version(1, 1, 4)),
    ],
)
def test_firmware_says_its_version_in_three_ways(text, version):
    assert decode_feedback(bytes.fromhex(text)).firmware == version


def test_hardware_104_is_1_0_4():
    assert decode_feedback(bytes.fromhex("0A 02 68 00")).hardware == Version(1, 0, 4)


def test_notes_are_the_references():
    assert (Sound.at(440, 0.1), Sound.at(523.25, 0.1)) == (Sound(826, 100), Sound(695, 100))


def test_no_word_that_lights_a_lamp_cuts_the_power():
    for output in Output:
        assert (Output.POWER | output) & 0x00F0 == 0x00F0


# --- Both ways -----------------------------------------------------------------------------------

U8, U16, U32 = (st.integers(0, 2**bits - 1) for bits in (8, 16, 32))
I8, I16 = (st.integers(-(2 ** (bits - 1)), 2 ** (bits - 1) - 1) for bits in (8, 16))

A_COMMAND = st.one_of(
    st.builds(BaseControl, I16, I16),
    st.builds(Sound, U16, U8),
    st.builds(SoundSequence, U8),
    st.builds(RequestExtra, U16),
    st.builds(GpOutput, U16),
    st.builds(SetGain, U8, U32, U32, U32),
    st.builds(GetGain, U8),
)
VERSION = st.builds(Version, U8, U8, U8)
MAYBE = {
    "core": st.builds(CoreSensors, U16, U8, U8, U8, U16, U16, I8, I8, U8, U8, U8, U8),
    "dock": st.builds(DockIr, U8, U8, U8),
    "inertia": st.builds(Inertia, I16, I16),
    "cliff": st.builds(CliffRaw, U16, U16, U16),
    "current": st.builds(MotorCurrent, U8, U8),
    "hardware": VERSION,
    "firmware": VERSION,
    "gyro": st.builds(GyroRaw, U8, st.lists(st.tuples(I16, I16, I16), max_size=8).map(tuple)),
    "gp": st.builds(GpInput, U16, U16, U16, U16, U16),
    "udid": st.builds(Udid, U32, U32, U32),
    "controller": st.builds(ControllerInfo, U8, U32, U32, U32),
}
A_FEEDBACK = st.builds(Feedback, **{name: st.none() | part for name, part in MAYBE.items()}).filter(
    lambda said: said != Feedback()
)


@settings(deadline=None)  # a machine may be busy
@given(st.lists(A_COMMAND, min_size=1, max_size=8))
def test_commands_come_out_as_they_went_in(commands):
    assert FrameReader(decode_commands).feed(encode_commands(*commands)) == [commands]


@settings(deadline=None)
@given(A_FEEDBACK)
def test_feedback_comes_out_as_it_went_in(said):
    assert FrameReader(decode_feedback).feed(encode_feedback(said)) == [said]


@settings(deadline=None)
@given(st.lists(A_FEEDBACK, min_size=1, max_size=5), st.integers(0, 2**32))
def test_it_does_not_matter_how_a_stream_is_cut(said, seed):
    chance, reader, heard = random.Random(seed), FrameReader(decode_feedback), []
    data = b"".join(map(encode_feedback, said))
    while data:
        size = chance.randrange(1, 100)
        heard += reader.feed(data[:size])
        data = data[size:]
    assert heard == said
    assert (reader.frames, reader.skipped_bytes) == (len(said), 0)


@settings(deadline=None)
@given(st.binary(max_size=2000))
def test_any_bytes_can_be_read(data):
    for reader in (FrameReader(decode_feedback), FrameReader(decode_commands)):
        reader.feed(data)
        true = frame(b"\x01\x04\x00\x00\x00\x00") * 40
        assert reader.feed(true) or reader.malformed or reader.feed(true)


@settings(deadline=None)
@given(st.binary(max_size=192))
def test_any_payload_is_read_or_malformed(payload):
    for decode in (decode_feedback, decode_commands):
        with contextlib.suppress(Malformed):
            decode(payload)


def test_an_unknown_sub_payload_is_left_out():
    sent = frame(b"\x63\x02\x01\x02" + b"\x06\x02\x07\x08")
    assert FrameReader(decode_feedback).feed(sent) == [Feedback(current=MotorCurrent(7, 8))]


def test_a_sub_payload_that_is_too_long_for_its_frame_is_damage():
    reader = FrameReader(decode_feedback)
    assert reader.feed(frame(b"\x06\x03\x07\x08")) == []
    assert reader.malformed == 1


def test_a_header_inside_a_frame_does_no_harm():
    said = Feedback(core=CoreSensors(0x55AA, left_ticks=0x55AA, right_ticks=0x55AA))
    sent = encode_feedback(said)
    reader = FrameReader(decode_feedback)
    assert reader.feed(sent + sent) == [said, said]
    # Half a frame, then a whole one: found again within it.
    assert reader.feed(sent[4:] + sent * 12)[-8:] == [said] * 8


def test_a_frame_that_cannot_be_is_not_made():
    for size in (2, 193):
        with pytest.raises(ValueError, match="3 to 192"):
            frame(bytes(size))


# --- Twists and orders (docs/reference/kobuki.md#speed-and-radius) --------------------------------


@pytest.mark.parametrize(
    ("twist", "control"),
    [
        (Twist(0.2, 0), (200, 0)),
        (Twist(-0.2, 0), (-200, 0)),
        (Twist(0, 1.8), (207, 1)),
        (Twist(0, -1.8), (-207, 1)),
        (Twist(0.2, 0.5), (258, 400)),  # the reference cuts 257.5 off at 257
        (Twist(0.2, -0.5), (258, -400)),
        (Twist(-0.2, 0.5), (-258, -400)),
        (Twist(-0.2, -0.5), (-258, 400)),
        (Twist(0.0005, 1), (115, 1)),
        (Twist(-0.0011, 1), (115, 1)),  # the reference's radius -1 means nothing
        (Twist(0.3, 0.00011), (300, 0)),  # the reference turns 80 times as fast as it was told
        (Twist(0.5, 0.01), (501, 32767)),
        (Twist(math.nan, 0), (0, 0)),
        (Twist(0.1, math.inf), (0, 0)),
    ],
)
def test_orders_are_the_references_but_for_four_faults(twist, control):
    assert twist_to_control(twist) == control


TWISTS = st.builds(Twist, st.floats(-1, 1), st.floats(-8, 8))


@settings(deadline=None)
@given(TWISTS)
def test_an_order_means_the_twist_it_was_made_from(twist):
    possible = slow_to_wheels(twist)
    meant = control_to_twist(twist_to_control(twist))
    # Half a millimeter per second of the outer wheel, half a millimeter of radius, the spot.
    radius_m = abs(possible.v_m_s / possible.w_rad_s) if possible.w_rad_s else math.inf
    tight = 0.0005 / max(radius_m, 0.0015)
    # Beyond a radius of 32.767 m, the largest, the outer wheel's speed stays and the middle's not.
    middle = WHEELBASE_M / 2 * abs(meant.w_rad_s - possible.w_rad_s) if radius_m > 32.767 else 0.0
    assert abs(meant.v_m_s - possible.v_m_s) <= 0.0006 + abs(possible.w_rad_s) * 0.0015 + middle
    assert abs(meant.w_rad_s - possible.w_rad_s) <= 0.0101 + abs(possible.w_rad_s) * tight


@settings(deadline=None)
@given(TWISTS)
def test_no_wheel_is_ordered_to_go_too_fast(twist):
    speeds = slow_to_wheels(twist).wheels_m_s
    assert max(map(abs, speeds)) <= WHEEL_MAX_M_S + 1e-9
    assert abs(twist_to_control(twist).speed_mm_s) <= 1000 * WHEEL_MAX_M_S


@settings(deadline=None)
@given(TWISTS)
def test_a_twist_that_is_slowed_keeps_its_curve(twist):
    slowed = slow_to_wheels(twist)
    assert slowed.v_m_s * twist.w_rad_s == pytest.approx(twist.v_m_s * slowed.w_rad_s)


@settings(deadline=None)
@given(st.builds(BaseControl, I16, I16))
def test_any_order_means_something(control):
    assert control_to_twist(control).is_finite


def test_a_radius_of_minus_one_is_a_curve():
    assert control_to_twist(BaseControl(-116, -1)) == Twist(-0.001, 1.0)


@pytest.mark.parametrize("twist", [STILL, Twist(0.0001, 0), Twist(0, 0.001)])
def test_what_is_slower_than_a_millimeter_stands(twist):
    assert control_to_twist(twist_to_control(twist)) == STILL
