"""A score on a Kobuki: its commands for lights and notes; external power stays on."""

from robot.bases import Indication
from robot.bases.kobuki import KobukiBase
from robot.bases.kobuki_protocol.commands import (
    GpOutput,
    Output,
    Sound,
    SoundSequence,
    decode_commands,
)
from robot.bases.kobuki_protocol.frames import FrameReader
from robot.motion.score import Color, Melody, Note


def sent(base):
    """Return what goes out beside the next order, but for requests."""
    frames = FrameReader(decode_commands).feed(base._extra_commands())
    kinds = (GpOutput, Sound, SoundSequence)
    return [command for frame in frames for command in frame if isinstance(command, kinds)]


def test_lights_notes_and_melodies_are_a_kobuki_s():
    base = KobukiBase(lambda: 5.0)
    sent(base)
    base.light(Color.ORANGE, Color.GREEN)
    base.play(Note(0.0, 440.0, 0.2))
    assert sent(base) == [
        Sound(826, 200),
        GpOutput(Output.POWER | Output.LED1_ORANGE | Output.LED2_GREEN),
    ]
    base.play(Note(0.0, melody=Melody.CLEANING_END))
    assert sent(base) == [SoundSequence(6)]
    base.show(Indication.READY, aloud=False)
    assert sent(base) == [GpOutput(Output.POWER | Output.LED1_GREEN)]


def test_a_stop_is_heard_and_red():
    base = KobukiBase(lambda: 5.0)
    base.light(Color.GREEN, Color.GREEN)
    base.show(Indication.STOPPED, aloud=True)
    assert sent(base) == [SoundSequence(4), GpOutput(Output.POWER | Output.LED1_RED)]
