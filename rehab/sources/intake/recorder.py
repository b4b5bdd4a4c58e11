"""Raw signals recorded beside the session, on this machine only."""

from __future__ import annotations

from pathlib import Path
from typing import TextIO

import numpy as np

from rehab.gait.recordings.column_mapping import OVERGROUND, SIGNAL_LAYOUTS
from rehab.gait.recordings.csv_files import write_rows
from rehab.sources.intake.alignment import FRAME, Channel, Floats
from rehab.sources.reporting import Notify, SourceError


class SignalRecorder:
    """Records samples in SI units as CSV, in the layout ``garry`` of ``rehab.gait``.

    The first samples define the channels; a channel that comes later is not written. A full disk
    ends the file, not the session.
    """

    def __init__(self, path: Path, notify: Notify, *, is_overground: bool = False) -> None:
        self.path = path
        self._marks = [OVERGROUND] if is_overground else []
        self._notify = notify
        self._channels: list[Channel] = []
        self._file: TextIO | None
        try:
            self._file = path.open("x", encoding="utf-8", newline="")
        except OSError as problem:
            raise SourceError(
                f"The recording {path} cannot be written: {problem.strerror}. Give --keep the name "
                "of a new file."
            ) from None

    def write(self, t_s: Floats, values: dict[Channel, Floats]) -> None:
        """Write samples to the file."""
        if self._file is None:
            return
        nothing = np.full(len(t_s), np.nan)
        try:
            if not self._channels:
                self._channels = sorted(values)
                layout = SIGNAL_LAYOUTS["garry"]
                names = [
                    name if (side, name) == FRAME else layout.legs[side][name].name
                    for side, name in self._channels
                ]
                self._file.write(",".join(["time_s", *names, *self._marks]) + "\n")
            columns = [t_s, *(values.get(channel, nothing) for channel in self._channels)]
            columns += [np.ones(len(t_s)) for _ in self._marks]
            counts = {1 + place for place, one in enumerate(self._channels) if one == FRAME}
            write_rows(self._file, np.column_stack(columns), counts)
            self._file.flush()
        except OSError as problem:
            self._notify(f"{self.path} ends here: {problem.strerror}. The session goes on without.")
            self._file = None

    def close(self) -> None:
        """Close the file."""
        if self._file is not None:
            self._file.close()
            self._file = None
