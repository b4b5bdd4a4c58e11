"""The clinics that live in this process: it alone writes the logs of their sessions."""

from __future__ import annotations

import asyncio
import contextvars
from collections.abc import Callable, Coroutine, Iterator
from typing import Any

from asgiref.sync import sync_to_async

from rehab.sessions.live.database import clinic_owners
from rehab.sessions.live.database.clinic_owners import Claim


class OwnedClinics:
    """The clinics of this process, each with the epoch under which it writes.

    Parameters
    ----------
    on_claimed
        Called with each clinic that was claimed.
    """

    def __init__(self, on_claimed: Callable[[Claim], None]) -> None:
        self.epochs: dict[int, int] = {}
        self._on_claimed = on_claimed
        self._claiming: dict[int, asyncio.Task[int]] = {}
        self._releasing: dict[int, asyncio.Event] = {}
        self._used: set[int] = set()  # since the last look

    def __contains__(self, clinic_id: object) -> bool:
        return clinic_id in self.epochs

    def __iter__(self) -> Iterator[int]:
        """Iterate over the clinics as they are now; they may come and go meanwhile."""
        return iter(list(self.epochs))

    async def own(self, clinic_id: int) -> int:
        """Return the epoch under which this process writes, claiming the clinic where need be.

        Raises OwnedElsewhere.
        """
        self._used.add(clinic_id)
        while (released := self._releasing.get(clinic_id)) is not None:
            await released.wait()
        if (epoch := self.epochs.get(clinic_id)) is not None:
            return epoch
        if clinic_id not in self._claiming:
            # Its own context: a request's ends with the request, and others wait for this too.
            self._claiming[clinic_id] = asyncio.get_running_loop().create_task(
                self._claim(clinic_id), context=contextvars.Context()
            )
        return await asyncio.shield(self._claiming[clinic_id])

    async def _claim(self, clinic_id: int) -> int:
        try:
            claim = await sync_to_async(clinic_owners.claim)(clinic_id)
            self.epochs[clinic_id] = claim.epoch
            self._on_claimed(claim)
            return claim.epoch
        finally:
            del self._claiming[clinic_id]

    def forget(self, clinic_id: int) -> None:
        """Forget a clinic that another process has taken."""
        self.epochs.pop(clinic_id, None)

    def find_unused(self) -> set[int]:
        """Return the clinics that nobody has asked for since the last look."""
        unused, self._used = self.epochs.keys() - self._used, set()
        return unused

    async def release(self, clinic_id: int, *after: Coroutine[Any, Any, None]) -> None:
        """Release a clinic once all that is left to do is done; who asks for it meanwhile waits."""
        self._releasing[clinic_id] = released = asyncio.Event()
        try:
            for work in after:
                await work
            if self.epochs.pop(clinic_id, None) is not None:
                await sync_to_async(clinic_owners.release)([clinic_id])
        finally:
            released.set()
            del self._releasing[clinic_id]

    async def release_all(self) -> None:
        """Release all clinics; what runs there goes on where the next process claims them."""
        await asyncio.gather(*self._claiming.values(), return_exceptions=True)
        held, self.epochs = list(self.epochs), {}
        await sync_to_async(clinic_owners.release)(held)
