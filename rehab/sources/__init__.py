"""Sources of steps: one module each, without Django, so that a clinic machine can run them.

A source supplies measurements in the order walked, unscored. ``client`` sends them to the
server, ``intake`` makes strides of what labs send, ``source`` defines what a source is.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from robot.plugins import Registry, check_class

if TYPE_CHECKING:
    from rehab.sources.source import LiveSource, PlayedSource

# Name: what it is for.
SUMMARIES = {
    "recording": "play a recorded session, or recorded signals",
    "synthetic": "simulate a patient, as strides or as signals",
    "rows": "lines of CSV or JSON from D-Flow, Nexus or any script",
    "matlab": "the original GARRY MATLAB server",
    "serial_sensor": "a sensor on a serial port, as an Arduino",
    "ble": "sensors on feet or shanks by Bluetooth",
    "lsl": "streams of the Lab Streaming Layer",
}


def _check_source(name: str, part: Any) -> None:
    from rehab.sources.source import Source

    check_class(Source)(name, part)


# A module is imported when its source is used: signals need numpy, a simulated patient does not.
SOURCES: Registry[type[PlayedSource | LiveSource]] = Registry(
    "garry.sources",
    {
        "recording": "rehab.sources.recording.source:RecordingSource",
        "synthetic": "rehab.sources.synthetic.source:SyntheticSource",
        "rows": "rehab.sources.rows:RowsSource",
        "matlab": "rehab.sources.matlab:MatlabSource",
        "serial_sensor": "rehab.sources.serial_sensor:SerialSensorSource",
        "ble": "rehab.sources.ble.source:BleSource",
        "lsl": "rehab.sources.lsl:LslSource",
    },
    _check_source,
)


def summarize(name: str) -> str:
    """Return what a source is for; of a plug-in what its package says of itself."""
    plugin = SOURCES.find_plugin(name)
    return plugin.summary if plugin else SUMMARIES[name]
