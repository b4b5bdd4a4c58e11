"""A power switch for a runtime's writer."""

from __future__ import annotations

import threading

from rehab.sessions.live.session.group_commit import Writer
from tests.support import callers


class PowerSwitch:
    """Takes the power from a runtime's writer: what is queued is neither written nor reported.

    One that is frozen writes it later, as a process that was suspended.
    """

    def __init__(self) -> None:
        self.dead: set[Writer] = set()  # the objects: numbers are used again
        self.frozen: dict[Writer, threading.Event] = {}
        self.open = threading.Event()
        self.open.set()

    def release(self) -> None:
        """Let every writer go on."""
        for event in (self.open, *self.frozen.values()):
            event.set()

    def wait(self, writer: Writer) -> None:
        """Wait until a writer may write (in its thread)."""
        self.open.wait(callers.PATIENCE_S)
        if writer in self.frozen:
            self.frozen[writer].wait(callers.PATIENCE_S)
