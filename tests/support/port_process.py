"""A process that owns a port, ordered by hand."""

import json
import subprocess
import sys
import time
from contextlib import contextmanager, suppress
from pathlib import Path

import psutil

from tests.support.fake_kobuki import FORWARD_200, STOP_FRAME

ROOT = Path(__file__).parents[2]


class Owner:
    """Orders a process by hand."""

    def __init__(self, url):
        self.number = 0
        self.process = subprocess.Popen(
            [sys.executable, "-W", "error", "-m", "robot.port", url, "--stop", STOP_FRAME.hex()],
            cwd=ROOT,
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
        )
        self.said = {}

    def order(self, frame, **more):
        self.number += 1
        order = {"number": self.number, "sent_s": time.monotonic(), "frame": frame.hex()}
        self.process.stdin.write(json.dumps(order | more).encode() + b"\n")
        self.process.stdin.flush()

    def hear(self):
        """Take one line of what it says."""
        self.said = json.loads(self.process.stdout.readline())
        return self.said

    def drive(self, for_s):
        """Order as a worker does, 50 times a second."""
        end_s = time.monotonic() + for_s
        self.order(STOP_FRAME)
        while time.monotonic() < end_s:
            self.order(FORWARD_200)
            time.sleep(0.02)

    def end(self):
        _, said = self.process.communicate(timeout=10)
        return said.decode()


@contextmanager
def owning(kobuki):
    owner = Owner(kobuki.url)
    try:
        while not owner.hear()["bytes"]:
            pass
        yield owner
    finally:
        # Its guard first: the next test may have a port of the same name.
        with suppress(psutil.NoSuchProcess):
            for guard in psutil.Process(owner.process.pid).children():
                guard.kill()
        owner.process.kill()
        owner.process.communicate()
