"""The programs that bring sensors' steps to the server, as a clinic types them."""

from __future__ import annotations

from dataclasses import dataclass

from django.utils.functional import Promise
from django.utils.translation import gettext_lazy as _


def write_command(source: str, server: str, token: str) -> str:
    """Return the line that starts a sensor's program with a source and its options."""
    return f"python -m rehab.sources {source} --stay --server {server} --token {token}"


@dataclass(frozen=True, slots=True)
class SensorProgram:
    """What reads a kind of sensor: the kind in words, and a source with its usual options."""

    kind: str | Promise
    source: str

    def command(self, server: str, token: str) -> str:
        """Return the line that starts it at the sensor's computer."""
        return write_command(self.source, server, token)


# Which options there are besides: docs/sources.md.
PROGRAMS = (
    SensorProgram(
        _("D-Flow, Nexus or a script of your own"), "rows --listen udp://0.0.0.0:9101 --mass 75"
    ),
    SensorProgram("Lab Streaming Layer", "lsl --stream Treadmill Mocap --mass 75"),
    SensorProgram(
        _("Sensors on both shins, by Bluetooth"), "ble --sensor left.shank=LEFT right.shank=RIGHT"
    ),
    SensorProgram(_("A sensor on a serial port, such as an Arduino"), "serial_sensor --mass 75"),
    SensorProgram(_("The original GARRY’s MATLAB server"), "matlab"),
    SensorProgram(_("No sensor yet: a simulated patient"), "synthetic --seed 1"),
)
