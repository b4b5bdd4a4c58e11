"""What the columns of a live stream are, found from half a minute of walking; nothing is sent."""

from __future__ import annotations

import asyncio
import time
from collections.abc import Callable, Iterable, Mapping, Sequence

import numpy as np

from rehab.gait.setup.check import check_setup
from rehab.gait.setup.report import describe_setup
from rehab.sources.client import LiveFeed
from rehab.sources.intake.alignment import Floats
from rehab.sources.intake.intake import Intake
from rehab.sources.intake.rows import VALUE, Cell
from rehab.sources.intake.settings import IntakeSettings
from rehab.sources.reporting import Notify, SourceError

CHECK_S = 30.0
NOTHING_AFTER_S = 15.0  # without a sample
ROWS_MAX = 300_000  # a minute at 5 kHz
TIME = "time_s"  # of streams whose samples carry their times beside the columns


class StreamCheck(Intake):
    """Takes the place of an ``Intake``: keeps half a minute of rows, whatever their columns are.

    Parameters
    ----------
    settings, notify, monotonic
        As in ``Intake``.
    seconds
        How long to listen from the first sample on, by our clock.
    """

    def __init__(
        self,
        settings: IntakeSettings,
        notify: Notify,
        monotonic: Callable[[], float] = time.monotonic,
        seconds: float = CHECK_S,
    ) -> None:
        super().__init__(LiveFeed(), settings, notify, monotonic)
        self.is_done = asyncio.Event()
        self._mass_kg, self._is_overground = settings.mass_kg, settings.is_overground or None
        self._say, self._clock, self._seconds = notify, monotonic, seconds
        self._first_s: float | None = None
        # By the columns that came together.
        self._rows: dict[tuple[str, ...], list[Sequence[float]]] = {}

    async def wait_for_start(self) -> None:
        """Return at once: there is no session."""

    async def wait_until_done(self) -> None:
        """Return once half a minute is over, whether or not the sender goes on.

        Says so, with the cure, where no sample arrives.
        """
        begin_s, is_told = self._clock(), False
        while not self.is_done.is_set():
            if self._first_s is not None:
                if self._clock() - self._first_s >= self._seconds:
                    return
            elif not is_told and self._clock() - begin_s >= NOTHING_AFTER_S:
                is_told = True
                self._say(
                    f"Nothing has arrived for {NOTHING_AFTER_S:.0f} s. Start the sender, and look "
                    "at its address, port and firewall; Ctrl-C ends the waiting."
                )
            await asyncio.sleep(0.1)

    def accepts(self, names: Iterable[str]) -> bool:
        """Return True: what the columns are is to be found."""
        return True

    def add_rows(self, rows: Iterable[Mapping[str, Cell]]) -> None:
        """Keep rows of numbers; a blank cell is NaN."""
        for row in rows:
            if VALUE in row:
                self.reject_row(
                    "Strides come, which need no check. Let the sender send raw signals."
                )
                continue
            names = tuple(name for name, cell in row.items() if not isinstance(cell, str))
            cells = (row[name] for name in names)
            self._keep(names, [[np.nan if cell is None else float(cell) for cell in cells]])

    def add_table(
        self,
        stream: str,
        names: Sequence[str],
        t_s: Floats,
        table: Floats,
        there: Floats | None = None,
    ) -> None:
        """Keep samples of a stream, with their times."""
        self._keep((TIME, *names), np.column_stack((t_s, table)).tolist())

    def _keep(self, names: tuple[str, ...], rows: Iterable[Sequence[float]]) -> None:
        now_s = self._clock()
        if self._first_s is None:
            self._first_s = now_s
            self._say(f"Samples come. Let somebody walk for {self._seconds:.0f} s.")
        kept = self._rows.setdefault(names, [])
        kept.extend(rows)
        if now_s - self._first_s >= self._seconds or len(kept) >= ROWS_MAX:
            self.is_done.set()

    def describe_setup(self) -> tuple[list[str], bool]:
        """Return what the columns are, as lines to read, and whether all of it is sure.

        Raises
        ------
        SourceError, GaitInputError
            With the cure, where nothing came or nothing is recognized.
        """
        if not self._rows:
            raise SourceError("No samples came. Start the sender, and look at its address.")
        names = max(self._rows, key=lambda one: (len(one), len(self._rows[one])))
        others = sorted({name for one in self._rows for name in one} - set(names))
        columns = np.array(self._rows[names], np.float64).T
        table = dict(zip(names, columns, strict=True))
        check = check_setup(table, self._mass_kg, is_overground=self._is_overground)
        lines = describe_setup(check)
        if others:
            lines.insert(0, f"Left out, as they come in rows of their own: {', '.join(others)}.")
        return lines, check.is_certain
