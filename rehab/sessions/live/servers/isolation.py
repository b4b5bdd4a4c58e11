"""A server that is cut off from the database while another one has it sends its clients there.

What they sent would wait unstored here, while the other server takes the sessions over. Where no
server reaches the database, clients stay and are notified that it does not answer.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Collection

from rehab.sessions.live.database.lease import Lease

REPORTED_S = 3.0  # each server reports each second whether it has the database


class Isolation:
    """Whether this server alone lacks the database.

    Parameters
    ----------
    own
        This server's lease, which is not current where the database does not answer.
    clock
        Seconds, which only grow.
    """

    def __init__(self, own: Lease, clock: Callable[[], float] = time.monotonic) -> None:
        self._own = own
        self._clock = clock
        self._current_at_s: dict[str, float] = {}  # of others: when they last had the database

    def record(self, server: str, *, is_current: bool) -> None:
        """Record what another server reports of its own lease."""
        if is_current:
            self._current_at_s[server] = self._clock()
        else:
            self._current_at_s.pop(server, None)

    def applies(self, others: Collection[str], *, is_silent: bool) -> bool:
        """Return whether clients are better off with another server.

        Parameters
        ----------
        others
            The servers that were there when the database was last read.
        is_silent
            Whether no message comes from any: then it is this server that is cut off.
        """
        if self._own.is_current or not others:
            return False
        since_s = self._clock() - REPORTED_S
        return is_silent or any(self._current_at_s.get(one, -1.0) > since_s for one in others)
