"""Shows that the event loop turns: to the server's lease, and to whoever supervises the server.

systemd and `serve --processes` listen at NOTIFY_SOCKET (sd_notify(3)), and end a server that has
been silent for 5 s. A lease is not renewed while the loop is silent, so that others take the
clinics over also where only the loop hangs, and the lease's thread does not.
"""

from __future__ import annotations

import asyncio
import os
import socket
from collections.abc import Callable
from contextlib import suppress

PULSE_S = 0.25
SILENT_S = 5.0  # then a supervisor ends the server; WatchdogSec in deploy/systemd


def notify(state: str) -> None:
    """Send a state to the supervisor, where there is one; never wait for it."""
    address = os.environ.get("NOTIFY_SOCKET", "")
    if not address or not hasattr(socket, "AF_UNIX"):
        return
    if address.startswith("@"):  # a name without a file
        address = f"\0{address[1:]}"
    with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as sender, suppress(OSError):
        sender.setblocking(False)
        sender.sendto(state.encode(), address)


async def keep_pulse(show: Callable[[], None] | None) -> None:
    """Show at each pulse that the loop turns, until cancelled.

    ``show``: of the lease, where the server has one.
    """
    while True:
        notify("WATCHDOG=1")
        if show is not None:
            show()
        await asyncio.sleep(PULSE_S)
