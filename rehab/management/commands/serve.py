"""`manage.py serve`: the whole clinic in one process."""

from __future__ import annotations

import os
import shlex
import signal
import socket
import sys
from argparse import ArgumentParser
from collections.abc import Callable
from typing import Any

from channels.routing import get_default_application
from django.conf import settings
from django.core.management import BaseCommand, CommandError

from rehab.boards.building.scheduler import board_builder
from rehab.people.sign_in.first_start import (
    FIRST_USERNAME,
    first_clinic,
    first_password,
    prepare_database,
)
from rehab.sessions.live.runtime import current
from rehab.sessions.live.server_lock import AnotherServer, ServerLock
from rehab.sessions.live.sources import local_address
from rehab.stations.builtin import first_station, issue_builtin_token
from rehab.stations.models import Device
from robot.bases import BASES


class Command(BaseCommand):
    """Prepares the database, prints the address, and serves pages and sockets until Ctrl-C."""

    help = "Serve GARRY: pages and sockets, one process."

    def add_arguments(self, parser: ArgumentParser) -> None:
        """Add the options."""
        parser.add_argument("--host", default=settings.HOST)
        parser.add_argument("--port", type=int, default=settings.PORT)
        parser.add_argument("--server", choices=("daphne", "uvicorn"), default="daphne")
        parser.add_argument(
            "--child",
            action="append",
            default=[],
            metavar="COMMAND",
            help="run this command beside the server, again when it fails (may be repeated)",
        )
        parser.add_argument(
            "--robot",
            choices=("none", *sorted(BASES)),
            default="none",
            metavar="BASE",
            help="run a robot with this base at the first station, unless that has one of its own",
        )

    def handle(
        self,
        *args: Any,
        host: str,
        port: int,
        server: str,
        child: list[str],
        robot: str,
        **options: Any,
    ) -> None:
        """Serve. Raises CommandError, with the cure, where the port is taken."""
        if robot != "none" and settings.HOSTED:
            raise CommandError("A hosted server runs no robot. Run `python -m robot` beside it.")
        check_port(host, port)
        lock = take_lock() if settings.HOSTED else None
        prepare_database()
        self._print_address(local_address(host, port))
        token = robot_token() if robot != "none" else None
        SERVERS[server](
            host,
            port,
            lambda: self._start_children(child, local_address(host, port), robot, token),
        )
        if lock is not None:
            lock.release()

    def _start_children(
        self, commands: list[str], address: str, base: str, token: str | None
    ) -> None:
        current().address = address
        if token is not None:
            robot = [sys.executable, "-m", "robot", "--base", base, "--server", address, "--child"]
            box = str(settings.DATA_DIR / "black_box")
            given = {"GARRY_ROBOT_TOKEN": token, "GARRY_ROBOT_BLACK_BOX": box}
            current().supervisor.start("robot", robot, given)
        for number, command in enumerate(commands, start=1):
            current().supervisor.start(f"child {number}", shlex.split(command))
        board_builder.wake()  # for boards that the last run has left unbuilt
        self.stdout.write("Ready. Ctrl-C stops the server.")
        self.stdout.flush()

    def _print_address(self, address: str) -> None:
        self.stdout.write(f"GARRY serves at {address}/")
        password = None if settings.HOSTED else first_password()
        if password:
            self.stdout.write(
                f"Sign in at {address}/start/ as {FIRST_USERNAME!r} with the password {password}"
            )
        self.stdout.flush()


def serve_by_daphne(host: str, port: int, on_ready: Callable[[], None]) -> None:
    """Serve until stopped."""
    from rehab.sessions.live.server import LiveServer  # installs a reactor: not at import

    LiveServer(
        get_default_application(),
        endpoints=[f"tcp:port={port}:interface={host.replace(':', chr(92) + ':')}"],
        server_name="GARRY",
        verbosity=0,
        on_ready=on_ready,
    ).run()


def serve_by_uvicorn(host: str, port: int, on_ready: Callable[[], None]) -> None:
    """Serve until stopped. Raises CommandError, with the cure, where uvicorn is not installed."""
    try:
        from rehab.sessions.live.uvicorn_server import UvicornLiveServer
    except ImportError as problem:
        raise CommandError(
            "uvicorn is not installed. Run pip install -c constraints.txt '.[server,hosted]', or "
            "serve by daphne."
        ) from problem
    UvicornLiveServer(get_default_application(), host, port, on_ready).run()


SERVERS = {"daphne": serve_by_daphne, "uvicorn": serve_by_uvicorn}


def take_lock() -> ServerLock:
    """Return the lock of the database's only server. Raises CommandError where another runs."""
    lock = ServerLock(on_lost=lambda: os.kill(os.getpid(), signal.SIGTERM))
    try:
        lock.acquire()
    except AnotherServer as problem:
        raise CommandError(str(problem)) from problem
    return lock


def robot_token() -> str | None:
    """Return a token for the first station's built-in robot; None if the station has its own."""
    station = first_station(first_clinic())
    robots = Device.everywhere.filter(station=station, kind=Device.Kind.ROBOT, builtin=False)
    if robots.filter(revoked_at__isnull=True).exists():
        return None
    return issue_builtin_token(station, Device.Kind.ROBOT)


def check_port(host: str, port: int) -> None:
    """Check that the address is free. Raises CommandError, with the cure, where it is not."""
    family = socket.AF_INET6 if ":" in host else socket.AF_INET
    with socket.socket(family, socket.SOCK_STREAM) as probe:
        probe.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        try:
            probe.bind((host, port))
        except OSError as problem:
            raise CommandError(
                f"Cannot serve at {host}:{port} ({problem.strerror}). Stop the other program, or "
                f"choose another port: GARRY_PORT={port + 1 if port < 65535 else 8000} make run."
            ) from problem
