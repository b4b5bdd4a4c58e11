"""Runs a session's source as a child process: a simulated patient or a recording."""

from __future__ import annotations

import sys

from asgiref.sync import sync_to_async

from rehab.sessions.live.supervisor import Supervisor
from rehab.sessions.models import TrainingSession
from rehab.stations.builtin import issue_builtin_token
from rehab.stations.models import Device


def local_address(host: str, port: int) -> str:
    """Return the address by which this machine reaches a server that listens at ``host``."""
    if host in {"0.0.0.0", "::"}:  # noqa: S104 (only compared)
        host = "127.0.0.1"
    return f"http://[{host}]:{port}" if ":" in host else f"http://{host}:{port}"


def child_name(session_id: int) -> str:
    """Return the name of a session's source among the child processes."""
    return f"source of session {session_id}"


async def run_source(supervisor: Supervisor, session: TrainingSession, server: str) -> None:
    """Start the source of ``session.source_args``, unless there is none or it runs already.

    ``server``: the address of this server.
    """
    name = child_name(session.pk)
    if not session.source_args or session.station is None or name in supervisor.children:
        return
    token = await sync_to_async(issue_builtin_token)(session.station, Device.Kind.SOURCE)
    command = [sys.executable, "-m", "rehab.sources", *session.source_args, "--child", "--resume"]
    place = ["--server", server, "--session", str(session.pk)]
    supervisor.start(name, [*command, *place], {"GARRY_TOKEN": token}, once=True)
