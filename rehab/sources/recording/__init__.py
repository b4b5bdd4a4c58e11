"""Recorded sessions: CSV files with one row a stride, in one of the known layouts.

``csv_text`` and ``table`` read text and know nothing of walking; ``layout`` defines what a layout
is, ``hebb`` and ``plain`` are the known ones; ``reading`` makes a ``recorded`` session of it all.
docs/recordings.md describes the layouts and every error.
"""

from rehab.sources.recording.layouts import LAYOUTS
from rehab.sources.recording.reading import parse_recording, read_recording
from rehab.sources.recording.recorded import RecordedStride, Recording
from rehab.sources.recording.table import RecordingError

__all__ = [
    "LAYOUTS",
    "RecordedStride",
    "Recording",
    "RecordingError",
    "parse_recording",
    "read_recording",
]
