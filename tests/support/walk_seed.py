"""Put sessions to walk into a server's database: `python -m tests.support.walk_seed JSON`.

JSON is a list of sessions: {"valence", "name", "phases": [{"kind", …}], "goal" (or
"goal_percent", of the baseline), "minutes", "screen": {"screen_side", …}, "pin", "close_percent"
(of the protocol), "measure", "words_vary"}, where anything may be left out; phrases vary only if
asked. Each gets a station of its own with tokens for its devices.
"""

from __future__ import annotations

import json
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import asdict, dataclass
from typing import TYPE_CHECKING, Any

import django
from websockets.sync.client import ClientConnection, connect

from tests.support.servers import ROOT, Server, clean_environment

if TYPE_CHECKING:
    from rehab.people.models import User

GOAL = 4.0


@dataclass(frozen=True)
class Walk:
    """A session that is ready to be walked."""

    session: int
    cookie: str
    source: str
    robot: str
    tablet: str

    @property
    def path(self) -> str:
        """The address of its patient's page."""
        return f"/sessions/{self.session}/"

    @property
    def monitor_path(self) -> str:
        """The address of the PT's page."""
        return f"{self.path}monitor/"


class Feet:
    """A source that sends what a test tells it to, and returns when it is stored."""

    def __init__(self, socket: ClientConnection, hello: dict[str, Any]) -> None:
        self._socket = socket
        self.say({"type": "hello", "version": 1, "run": str(id(self)), "last": 0} | hello)
        self.number: int = self.hear("welcome")["next"] - 1

    def say(self, message: dict[str, Any]) -> None:
        """Send a frame."""
        self._socket.send(json.dumps(message))

    def hear(self, kind: str) -> dict[str, Any]:
        """Return the next message of a type."""
        return hear(self._socket, kind)

    def walk(self, *performances: float | None, sd: float | None = None) -> None:
        """Take steps of these shares of the goal; None for one that was not measured.

        ``sd``: how uncertain the values are, if they tell.
        """
        extra = {} if sd is None else {"extra": {"a2_sd_w_kg": sd}}
        steps = []
        for performance in performances:
            self.number += 1
            value = None if performance is None else performance * GOAL
            time_s = self.number * 1.07
            step = {"number": self.number, "time_s": time_s, "side": "left", "value": value}
            steps.append(step | extra)
        self.say({"type": "steps", "steps": steps})
        while self.hear("ack")["number"] < self.number:
            pass


@contextmanager
def feet_of(server: Server, walk: Walk, **hello: Any) -> Iterator[Feet]:
    """Connect a session's source, which says this of itself; unless told, it is never late."""
    url = f"ws://127.0.0.1:{server.port}/ws/source/"
    with connect(url, additional_headers={"Authorization": f"Bearer {walk.source}"}) as socket:
        yield Feet(socket, hello or {"speed": None})


@contextmanager
def robot_of(server: Server, walk: Walk, base: str = "null") -> Iterator[ClientConnection]:
    """Connect a session's robot. All that it is sent is stored, whether it is read or not."""
    url, header = f"ws://127.0.0.1:{server.port}/ws/robot/", f"Bearer {walk.robot}"
    with connect(url, additional_headers={"Authorization": header}, max_queue=None) as robot:
        robot.send(json.dumps({"type": "hello", "version": 1, "base": base}))
        yield robot


def hear(robot: ClientConnection, kind: str) -> dict[str, Any]:
    """Return the next message of a type."""
    while True:
        message: dict[str, Any] = json.loads(robot.recv(10))
        if message["type"] == kind:
            return message


def make_walks(server: Server, *wanted: dict[str, Any]) -> list[Walk]:
    """Make sessions in a running server's database."""
    made = subprocess.run(
        [sys.executable, "-m", "tests.support.walk_seed", json.dumps(wanted)],
        cwd=ROOT,
        env=clean_environment(server.folder, server.port)
        | {"DJANGO_SETTINGS_MODULE": "garry_site.settings"},
        check=True,
        capture_output=True,
        text=True,
    )
    return [Walk(**row) for row in json.loads(made.stdout)]


def browser_session(user: User) -> str:
    """Return the key of a new browser session in which a user has just signed in."""
    from importlib import import_module

    from django.conf import settings
    from django.contrib.auth import BACKEND_SESSION_KEY, HASH_SESSION_KEY, SESSION_KEY
    from django.utils import timezone

    from rehab.people.sign_in.step_up import CONFIRMED_AT
    from rehab.people.sign_in.two_stage_sign_in import BACKEND

    cookies = import_module(settings.SESSION_ENGINE).SessionStore()
    cookies[SESSION_KEY] = str(user.pk)
    cookies[BACKEND_SESSION_KEY] = BACKEND
    cookies[HASH_SESSION_KEY] = user.get_session_auth_hash()
    cookies[CONFIRMED_AT] = int(timezone.now().timestamp())  # by the password
    cookies.save()
    return str(cookies.session_key)


def seed(wanted: list[dict[str, Any]]) -> list[dict[str, Any]]:
    """Make the sessions, and one PT who may see them all."""
    from rehab.people.models import Patient, User
    from rehab.people.roles import Role
    from rehab.people.sign_in.first_start import first_clinic
    from rehab.sessions.services import SessionRequest, create_session
    from rehab.sessions.setup.protocol_models import MeasureDefinition, Protocol
    from rehab.stations.models import Device, Station
    from rehab.stations.pins import set_pin
    from rehab.training.goals import GoalRule, Target
    from rehab.training.phases import make_phase
    from tests.support.tablets import approved

    clinic = first_clinic()
    count = User.everywhere.count()
    person = User.everywhere.create_user(f"walker{count}", role=Role.PT, clinic=clinic)
    cookie = browser_session(person)
    made = []
    for index, wish in enumerate(wanted):
        name = f"{count}-{index}"
        station = Station(clinic=clinic, name=f"Treadmill {name}")
        set_pin(station, wish.get("pin", ""))
        station.save()
        patient = Patient.everywhere.create(
            clinic=clinic,
            code=name,
            nickname=wish.get("name", "Rosa"),
            paretic_side="left",
            **wish.get("screen", {}),
        )
        tokens = {}
        for kind in Device.Kind.values:
            _, tokens[kind] = approved(station, kind, kind=kind)
        phases = [make_phase(**phase) for phase in wish.get("phases", [{"kind": "training"}])]
        protocol = None
        if "close_percent" in wish:
            protocol = Protocol.everywhere.create(
                clinic=clinic, name=name, close_percent=wish["close_percent"]
            )
            for position, phase in enumerate(phases, 1):
                protocol.phases.create(position=position, **asdict(phase))
        session = create_session(
            SessionRequest(
                patient=patient,
                valence=wish.get("valence", "positive"),
                goal=GoalRule(percent_of_baseline=wish["goal_percent"])
                if "goal_percent" in wish
                else GoalRule(value=wish.get("goal", GOAL)),
                measure=MeasureDefinition.everywhere.get(
                    clinic=None, slug=wish.get("measure", "a2")
                ),
                phases=phases,
                protocol=protocol,
                target=Target(duration_s=60 * wish.get("minutes", 10)),
                station=station,
                created_by=person,
                words_vary=wish.get("words_vary", False),
            )
        )
        made.append({"session": session.pk, "cookie": cookie, **tokens})
    return made


if __name__ == "__main__":
    django.setup()
    print(json.dumps(seed(json.loads(sys.argv[1]))))
