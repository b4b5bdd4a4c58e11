"""`manage.py serve`: the whole clinic in one process, or several for a hosted database."""

from __future__ import annotations

import shlex
import socket
import sys
from argparse import ArgumentParser
from collections.abc import Callable
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from channels.routing import get_default_application
from django.conf import settings
from django.core.management import BaseCommand, CommandError
from django.db import connection
from django.utils import timezone

from rehab.management.processes import Processes
from rehab.people.commands import command
from rehab.people.sign_in.first_start import (
    FIRST_USERNAME,
    first_clinic,
    first_password,
    prepare_database,
)
from rehab.sessions.live.database.server_lease import Lease
from rehab.sessions.live.pulse import notify
from rehab.sessions.live.runtime import current
from rehab.sessions.live.supervisor import local_address
from rehab.stations.builtin import first_station, issue_builtin_token
from rehab.stations.https.certificate import (
    find_certificate,
    is_encrypting,
    make_own,
    secure_host,
)
from rehab.stations.models import Device
from robot.bases import BASES


class Command(BaseCommand):
    """Prepares the database, prints the address, and serves pages and sockets until Ctrl-C."""

    help = "Serve GARRY: pages and sockets."

    def add_arguments(self, parser: ArgumentParser) -> None:
        """Add the options."""
        parser.add_argument("--host", default=settings.HOST)
        parser.add_argument("--port", type=int, default=settings.PORT)
        parser.add_argument(
            "--https",
            action="store_true",
            help="make a certificate of the clinic's own where there is none, for phones",
        )
        parser.add_argument(
            "--processes",
            type=int,
            metavar="N",
            help="so many servers, at this port and those after it, each ended and started again "
            "where it hangs; hosted, on PostgreSQL. SIGHUP restarts them one after the other.",
        )
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
        https: bool,
        processes: int | None,
        child: list[str],
        robot: str,
        **options: Any,
    ) -> None:
        """Serve. Raises CommandError, with the cure, where the port is taken."""
        if processes is not None:
            check_sharing(processes)
            if child or robot != "none":
                raise CommandError("Several servers run no other programs. Run them beside.")
            ports = range(port, port + processes)
            for one in ports:
                check_port(host, one)
            prepare_database()
            commands = [serve_command(host, one) for one in ports]
            with TemporaryDirectory(prefix="garry-serve-") as folder:
                Processes(commands, Path(folder)).run()
            return
        if robot != "none" and settings.HOSTED:
            raise CommandError("A hosted server runs no robot. Run `python -m robot` beside it.")
        check_port(host, port)
        prepare_database(self._say)
        if https or is_encrypting():
            prepare_https(make=https)
        lease = take_lease(host, port) if settings.HOSTED else None
        self._print_address(local_address(host, port))
        token = robot_token() if robot != "none" else None
        address = local_address(host, port)
        run_server(host, port, lambda: self._start_children(child, address, robot, token))
        if lease is not None:
            lease.release()

    def _start_children(
        self, commands: list[str], address: str, base: str, token: str | None
    ) -> None:
        current().address = address
        if token is not None:
            robot = [sys.executable, "-m", "robot", "--base", base, "--server", address, "--child"]
            box = str(settings.DATA_DIR / "black_box")
            given = {"GARRY_ROBOT_TOKEN": token, "GARRY_ROBOT_BLACK_BOX": box}
            current().supervisor.start("robot", robot, given)
        for number, line in enumerate(commands, start=1):
            current().supervisor.start(f"child {number}", shlex.split(line))
        self._say("Ready. Ctrl-C stops the server.")
        notify("READY=1")

    def _say(self, words: str) -> None:
        self.stdout.write(words)
        self.stdout.flush()  # at once, also into a file

    def _print_address(self, address: str) -> None:
        self.stdout.write(f"GARRY serves at {address}/")
        if secure := secure_host():
            self.stdout.write(f"Phones and tablets: https://{secure}/")
        password = None if settings.HOSTED else first_password()
        if password:
            self.stdout.write(
                f"Sign in at {address}/start/ as {FIRST_USERNAME!r} with the password {password}"
            )
        self.stdout.flush()


def prepare_https(*, make: bool) -> None:
    """Check port and certificate of https; make one of the clinic's own. Raises CommandError."""
    from rehab.sessions.live.https_port import BadCertificate, make_context

    if settings.HOSTED:
        raise CommandError(
            "A hosted server's proxy encrypts (its page /help/hosting/). Leave out --https."
        )
    check_port("0.0.0.0", settings.HTTPS_PORT)  # noqa: S104
    if make and not is_encrypting():
        make_own(timezone.now())
    files = find_certificate()
    try:
        if files is not None:
            make_context(files)
    except BadCertificate as problem:
        raise CommandError(str(problem)) from None


def run_server(host: str, port: int, on_ready: Callable[[], None]) -> None:
    """Serve until stopped."""
    from rehab.sessions.live.daphne_server import LiveServer  # installs a reactor: not at import

    LiveServer(
        get_default_application(),
        endpoints=[f"tcp:port={port}:interface={host.replace(':', chr(92) + ':')}"],
        server_name="GARRY",
        verbosity=0,
        on_ready=on_ready,
    ).run()


def serve_command(host: str, port: int) -> list[str]:
    """Return the command of one of several servers."""
    return [sys.executable, sys.argv[0], "serve", "--host", host, "--port", str(port)]


def check_sharing(processes: int) -> None:
    """Check that servers can share the database. Raises CommandError, with the cure."""
    if processes < 1:
        raise CommandError("Give --processes 1 or more.")
    if not (settings.HOSTED and connection.vendor == "postgresql"):
        raise CommandError(
            "Several servers share a PostgreSQL database. Set GARRY_HOSTED=1 and "
            "GARRY_DATABASE_URL=postgres://…, or serve by one process."
        )
    if settings.ADDRESS and processes > 1:
        raise CommandError(
            "GARRY_ADDRESS is the address of one server. Unset it: several have the host's and "
            "their ports'. Or start each by a `serve` of its own."
        )


def take_lease(host: str, port: int) -> Lease:
    """Return the lease of a hosted server."""
    lease = Lease(settings.ADDRESS or f"{host}:{port}")
    lease.acquire()
    return lease


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
                f"choose another port: GARRY_PORT={port + 1 if port < 65535 else 8000} "
                f"{command('serve')}."
            ) from problem
