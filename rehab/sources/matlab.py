"""A client of the original GARRY MATLAB server (GarryMatlabServer.m).

That server waits for a keyword, then sends ``a2, goal`` for each stride, and ``end``.
"""

from __future__ import annotations

import asyncio
import math
from argparse import ArgumentParser, Namespace

from websockets.asyncio.client import ClientConnection, connect
from websockets.exceptions import ConnectionClosed, WebSocketException

from rehab.sources.intake import Intake, IntakeSettings, parse_address
from rehab.sources.intake.rows import Cell
from rehab.sources.reporting import Notify
from rehab.sources.source import LiveSource
from rehab.training.steps import Side

RETRY_S = 1.0
KEYWORDS = ("start", "one", "two", "three", "four", "five")


class MatlabSource(LiveSource):
    """Sends the keyword when the session starts, as the original's tablet did, and reads strides.

    MATLAB sends no times: a stride's time is when it comes. Its goal is sent on as ``matlab_goal``;
    the goal that counts is the therapist's.
    """

    @classmethod
    def add_arguments(cls, parser: ArgumentParser) -> None:
        """Add the options of this source to a command line."""
        parser.add_argument(
            "--connect", default="ws://127.0.0.1:4000", metavar="URL", help="default: %(default)s"
        )
        parser.add_argument(
            "--keyword",
            default="one",
            help=f"which data to ask for; the original knows {', '.join(KEYWORDS)} (default one)",
        )

    def __init__(self, options: Namespace, notify: Notify) -> None:
        """Read the command line. Raises SourceError for an invalid address."""
        self.settings = IntakeSettings(side=Side(options.side) if options.side else None)
        self.address = parse_address(options.connect, ("ws",))
        self._keyword: str = options.keyword
        self._notify = notify
        self._goal: float | None = None

    async def read(self, intake: Intake) -> None:
        """Read strides until MATLAB sends ``end``; start over where the connection breaks."""
        last_problem = ""
        while True:
            await intake.wait_for_start()
            try:
                async with connect(str(self.address), proxy=None, compression=None) as socket:
                    last_problem = ""
                    if await self._receive_all(socket, intake):
                        self._notify("MATLAB has sent all.")
                        return
            except (OSError, WebSocketException) as problem:
                text = f"No MATLAB server at {self.address} ({problem})"
                if text != last_problem:
                    self._notify(
                        f"{text}. Start GarryMatlabServer there; trying every {RETRY_S:g} s."
                    )
                last_problem = text
            await asyncio.sleep(RETRY_S)

    async def _receive_all(self, socket: ClientConnection, intake: Intake) -> bool:
        """Read strides; return whether MATLAB has sent them all."""
        await socket.send(self._keyword)
        self._notify(f"Asked MATLAB for {self._keyword!r}.")
        try:
            async for message in socket:
                if message == "end":
                    return True
                row = self._read(message)
                if row is None:
                    intake.reject_row(
                        f"MATLAB sent {message[:40]!r}. Let it send sprintf('%f, %f', a2, goal)."
                    )
                else:
                    intake.add_rows([row])
        except ConnectionClosed:
            pass
        self._notify(f"MATLAB hung up before the end. Asking for {self._keyword!r} anew.")
        return False

    def _read(self, message: str | bytes) -> dict[str, Cell] | None:
        """Return the stride in a message, None where there is none."""
        words = message.split(",") if isinstance(message, str) else []
        try:
            a2, goal = (float(word) for word in words)
        except ValueError:
            return None
        row: dict[str, Cell] = {"value": a2}
        if math.isfinite(goal):
            row["matlab_goal"] = goal
            if goal != self._goal:
                self._notify(f"MATLAB's goal is {goal:g}; the session's own is what counts.")
            self._goal = goal
        return row
