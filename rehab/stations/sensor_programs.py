"""The programs that bring sensors' steps to the server, as a clinic types them."""

from __future__ import annotations

from dataclasses import dataclass, field

from django.utils.functional import Promise
from django.utils.html import format_html
from django.utils.safestring import SafeString
from django.utils.translation import gettext_lazy as _


@dataclass(frozen=True, slots=True)
class Blank:
    """A value of a line that each clinic has its own of: a usual one, and where to find it."""

    usual: str
    label: str | Promise
    where: str | Promise


@dataclass(frozen=True, slots=True)
class SensorProgram:
    """What reads a kind of sensor: the kind in words, and a source with its usual options."""

    kind: str | Promise
    source: str
    blanks: dict[str, Blank] = field(default_factory=dict)

    def command(self, server: str, token: str) -> SafeString:
        """Return the line that starts it at the sensor's computer, its blanks to be filled in."""
        line = f"python -m rehab.sources {self.source} --stay --server {{server}} --token {{token}}"
        values = {
            name: format_html('<b data-blank="{}">{}</b>', name, blank.usual)
            for name, blank in self.blanks.items()
        }
        return format_html(line, server=server, token=token, **values)


MASS = Blank(
    "75",
    _("Body mass of who walks, kg"),
    _("For somebody else, end the program and start it with their mass."),
)
STREAM = _("As LabRecorder lists it.")
NAME = _("Its name or address, as on its label or in its app.")

# Which options there are besides: docs/sources.md.
PROGRAMS = (
    SensorProgram(
        _("D-Flow, Nexus or a script of your own"),
        "rows --listen udp://0.0.0.0:{port} --mass {mass}",
        {
            "port": Blank(
                "9101",
                _("UDP port"),
                _("The one to which the laboratory’s program sends; set it there."),
            ),
            "mass": MASS,
        },
    ),
    SensorProgram(
        "Lab Streaming Layer",
        "lsl --stream {forces} {angles} --mass {mass}",
        {
            "forces": Blank("Treadmill", _("Name of the stream with the forces"), STREAM),
            "angles": Blank("Mocap", _("Name of the stream with the angles"), STREAM),
            "mass": MASS,
        },
    ),
    SensorProgram(
        _("Sensors on both shins, by Bluetooth"),
        "ble --sensor left.shank={left} right.shank={right}",
        {
            "left": Blank("LEFT", _("Sensor on the left shin"), NAME),
            "right": Blank("RIGHT", _("Sensor on the right shin"), NAME),
        },
    ),
    SensorProgram(
        _("A sensor on a serial port, such as an Arduino"),
        "serial_sensor --mass {mass}",
        {"mass": MASS},
    ),
    SensorProgram(_("The original GARRY’s MATLAB server"), "matlab"),
    SensorProgram(_("No sensor yet: a simulated patient"), "synthetic --seed 1"),
)
