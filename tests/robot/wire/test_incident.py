"""Recordings as the text of a frame: whole, bounded, and nothing else is taken for one."""

import base64
import json
import random
import zlib

import pytest

from robot.wire.frames import BadFrame
from robot.wire.incident import MAX_FILE_BYTES, MAX_TEXT_CHARS, pack, unpack
from robot.wire.limits import MAX_FRAME_BYTES


def test_half_a_minute_fits_a_frame_whole():
    chance = random.Random(1)
    records = [
        {"at_s": number / 50, "tick": [round(chance.uniform(-1, 1), 4) for _ in range(7)]}
        for number in range(1_750)
    ]
    text = pack(records[-600:])  # nothing is as hard to pack as chance
    assert unpack(text) == records[-600:]
    cut = pack(records)
    assert len(json.dumps({"recording": cut})) < MAX_FRAME_BYTES
    assert unpack(cut) == records[-len(unpack(cut)) :]
    assert len(unpack(cut)) >= 600


@pytest.mark.parametrize(
    "text",
    [
        *("", "no base64!", "é", base64.b64encode(b"no zlib").decode()),
        base64.b64encode(zlib.compress(b"x" * 100)[:-5]).decode(),
        base64.b64encode(zlib.compress(b"\xff\xfe")).decode(),
        base64.b64encode(zlib.compress(bytes(MAX_FILE_BYTES + 1))).decode(),
    ],
)
def test_any_other_text_is_refused(text):
    assert len(text) <= MAX_TEXT_CHARS
    with pytest.raises(BadFrame, match="recording"):
        unpack(text)


def test_lines_that_are_no_records_are_left_out():
    lines = b'{"at_s":1,"retained":"bump"}\n[]\n{"at_s":"x"}\n{"at_s":tru\n' + b"[" * 5000
    packed = base64.b64encode(zlib.compress(lines)).decode()
    assert unpack(packed) == [{"at_s": 1, "retained": "bump"}]
