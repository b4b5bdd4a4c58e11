"""Sources of steps: one module each, without Django, so that a clinic machine can run them.

A source supplies measurements in the order walked, unscored. ``client`` sends them to the
server, ``intake`` makes strides of what labs send, ``source`` defines what a source is.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from rehab.sources.source import LiveSource, PlayedSource

# Name: the module that has it as SOURCE, and what it is for. A module is imported when its source
# is used: signals need numpy, a simulated patient does not.
SOURCES: dict[str, tuple[str, str]] = {
    "recording": ("rehab.sources.recording.source", "play a recorded session, or recorded signals"),
    "synthetic": ("rehab.sources.synthetic.source", "simulate a patient, as strides or as signals"),
    "rows": ("rehab.sources.rows", "lines of CSV or JSON from D-Flow, Nexus or any script"),
    "matlab": ("rehab.sources.matlab", "the original GARRY MATLAB server"),
    "serial_sensor": ("rehab.sources.serial_sensor", "a sensor on a serial port, as an Arduino"),
    "ble": ("rehab.sources.ble.source", "sensors on feet or shanks by Bluetooth"),
    "lsl": ("rehab.sources.lsl", "streams of the Lab Streaming Layer"),
}


def load_source(name: str) -> type[PlayedSource | LiveSource]:
    """Return the registered source of that name."""
    source: type[PlayedSource | LiveSource] = import_module(SOURCES[name][0]).SOURCE
    return source
