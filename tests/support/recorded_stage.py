"""A stage whose black box records it, with the session's motion; and a reader of that file."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

from robot.black_box.capture import Capture
from robot.black_box.recorder import BlackBox
from tests.support.robot_stage import Stage


class RecordedStage(Stage):
    """A performer with a black box in a folder."""

    def __init__(self, folder: Path) -> None:
        super().__init__()
        self.box = BlackBox(folder, lambda: self.now_s, keeps_motion=True)
        self.box.begin()
        self.capture = Capture(self.box, self.robot, self.base)

    def hear(self, **message: Any) -> None:
        super().hear(**message)
        self.capture.record_message(message)

    def wait(self, span_s: float) -> None:
        for _ in range(round(span_s / 0.02)):
            super().wait(0.02)
            self.capture.record_tick(self.now_s)
        self.box.write()  # as its thread does, before too much waits

    def close(self) -> None:
        self.box._is_closing.set()
        self.box.write()


def read(path: Path) -> dict[str, list[tuple[int, Any]]]:
    """Return each topic's messages of an MCAP file, by the format's own reader."""
    from mcap.reader import make_reader

    topics: dict[str, list[tuple[int, Any]]] = {}
    with path.open("rb") as file:
        for _, channel, message in make_reader(file).iter_messages():
            at_ns, data = message.log_time, json.loads(message.data)
            topics.setdefault(channel.topic, []).append((at_ns, data))
    return topics
