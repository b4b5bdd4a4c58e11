"""The first steps of a new clinic: what is there already, tested as far as a server can."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from datetime import datetime

from django.utils.functional import Promise
from django.utils.translation import gettext as _
from django.utils.translation import gettext_lazy

from rehab.people.models import Patient, User
from rehab.people.simulated import counted
from rehab.sessions.live import runtime
from rehab.sessions.models import TrainingSession
from rehab.stations.device_trust import find_ended
from rehab.stations.models import Device, Station
from rehab.stations.presence import format_device_states


@dataclass(frozen=True, slots=True)
class Found:
    """What is there of a step now: whether that is enough, in words."""

    is_done: bool
    words: str


@dataclass(frozen=True, slots=True)
class FirstStep:
    """A step: its name in addresses, its title, what it is for, and what looks if it is done."""

    slug: str
    title: str | Promise
    purpose: str | Promise
    look: Callable[[User, datetime], Found]


def _look_for_station(user: User, now: datetime) -> Found:
    names = [str(station) for station in Station.objects.visible_to(user)]
    if not names:
        return Found(False, _("No station yet."))
    return Found(True, ", ".join(names))


def _look_for_tablet(user: User, now: datetime) -> Found:
    tablets = list_devices(user, Device.Kind.TABLET)
    if not tablets:
        return Found(False, _("No tablet is paired yet."))
    is_paired = bool({one.pk for one in tablets} - find_ended(tablets, now))
    states = format_device_states(tablets, now)
    return Found(is_paired, ", ".join(f"{one.name}, {state}" for one, state in states))


def _look_for_sensor(user: User, now: datetime) -> Found:
    sources = list_devices(user, Device.Kind.SOURCE)
    if not sources:
        return Found(False, _("No sensor yet."))
    running = runtime.peek()
    connected = running.devices.connected_ids() if running else set()
    here = [one.name for one in sources if one.pk in connected]
    if here:
        return Found(True, _("%(sensor)s is connected.") % {"sensor": ", ".join(here)})
    words = _("Not connected now: %(sensors)s. Start its program on the computer of the sensor.")
    return Found(False, words % {"sensors": ", ".join(one.name for one in sources)})


def _look_for_patient(user: User, now: datetime) -> Found:
    if not Patient.objects.visible_to(user).filter(counted()).exists():
        return Found(False, _("No patient yet."))
    return Found(True, _("There are patients."))


STEPS = (
    FirstStep(
        "station",
        gettext_lazy("Station"),
        gettext_lazy("A place with its tablet, its sensor and its robot."),
        _look_for_station,
    ),
    FirstStep(
        "tablet",
        gettext_lazy("Tablet"),
        gettext_lazy("It shows the patient’s page, and is let in once."),
        _look_for_tablet,
    ),
    FirstStep(
        "sensor",
        gettext_lazy("Sensor"),
        gettext_lazy("Force plates, a worn sensor or a phone on the shin measure the steps."),
        _look_for_sensor,
    ),
    FirstStep(
        "patient",
        gettext_lazy("First patient"),
        gettext_lazy("A nickname and a code are enough to begin."),
        _look_for_patient,
    ),
)


def look_at_all(user: User, now: datetime) -> dict[str, Found]:
    """Return what is there of each step, by its slug."""
    return {step.slug: step.look(user, now) for step in STEPS}


def is_new(user: User) -> bool:
    """Return whether no patient of a person's clinic has walked yet, but simulated ones."""
    walked = TrainingSession.objects.visible_to(user).filter(counted(), active_s__gt=0)
    return not walked.exists()


def list_devices(user: User, kind: Device.Kind) -> list[Device]:
    """Return a clinic's devices of a kind that may connect, but the server's own."""
    devices = Device.objects.visible_to(user).filter(kind=kind, builtin=False, revoked_at=None)
    return list(devices.order_by("name"))
