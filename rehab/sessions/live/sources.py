"""The source that the server itself runs for a session: a simulated patient or a recording."""

from __future__ import annotations

import sys

from asgiref.sync import sync_to_async

from rehab.sessions.live.supervisor import Children
from rehab.sessions.models import TrainingSession
from rehab.stations.builtin import issue_builtin_token
from rehab.stations.models import Device


def local_address(host: str, port: int) -> str:
    """Give the address by which a server that listens at ``host`` is reached on this machine."""
    if host in {"0.0.0.0", "::"}:  # noqa: S104 (only compared)
        host = "127.0.0.1"
    return f"http://[{host}]:{port}" if ":" in host else f"http://{host}:{port}"


def child_name(session_id: int) -> str:
    """Give the name of a session's source among the server's children."""
    return f"source of session {session_id}"


async def run_source(children: Children, session: TrainingSession, server: str) -> None:
    """Start what ``session.source_args`` says, if anything and if it does not run yet.

    ``server`` is where this process answers.
    """
    name = child_name(session.pk)
    if not session.source_args or session.station is None or name in children.all:
        return
    token = await sync_to_async(issue_builtin_token)(session.station, Device.Kind.SOURCE)
    command = [sys.executable, "-m", "rehab.sources", *session.source_args, "--child", "--resume"]
    place = ["--server", server, "--session", str(session.pk)]
    children.start(name, [*command, *place], {"GARRY_TOKEN": token}, once=True)
