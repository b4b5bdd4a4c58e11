"""The gate before the sign-in: what a flood of attempts may cost the server.

It stands before Django, so that an attempt which is refused costs next to nothing: training
sessions run in the same process. Its counts are in memory; those that lock accounts are in the
database (`attempts`). However many strangers try, each clinic has a lane for the networks and
browsers from which it signed in lately (`known_browsers`).
"""

from __future__ import annotations

import asyncio
import time
from collections.abc import Awaitable, Callable, Mapping
from functools import lru_cache
from typing import Any

from django.http import parse_cookie
from django.utils import translation
from django.utils.translation import gettext as _
from django.utils.translation.trans_real import parse_accept_lang_header

from rehab.people.networks import resolve_client_address
from rehab.people.sign_in.known_browsers import Lanes
from rehab.people.token_buckets import TokenBucket, TokenBuckets

PATH = "/sign-in/"
BURST = 30  # attempts at once from one address: the staff of a clinic may share one
INTERVAL_S = 2.0  # between further ones
ALL_BURST = 40  # attempts at once from all addresses
ALL_INTERVAL_S = 0.25  # between further ones
LANE_BURST = 10  # attempts at once in a clinic's lane, beside those
LANE_INTERVAL_S = 1.0  # between further ones
AT_ONCE = 1  # inside Django: several held up each other and the steps (docs/performance.md)
MAX_WAITING = 19
MAX_WAITING_IN_LANES = 10  # beside those


# Returns the lane of a browser with these cookies at an address; None for strangers.
FindLane = Callable[[Mapping[str, str], str], Awaitable[int | None]]


class SignInGate:
    """An ASGI application that lets so many attempts to sign in through to another one."""

    def __init__(
        self,
        inner: Any,
        clock: Callable[[], float] = time.monotonic,
        find_lane: FindLane | None = None,
    ) -> None:
        self._inner = inner
        self._clock = clock
        self._find_lane = find_lane or Lanes().find
        self._lanes = TokenBuckets(LANE_BURST, LANE_INTERVAL_S)
        self._addresses = TokenBuckets(BURST, INTERVAL_S)
        self._all = TokenBucket(ALL_BURST, ALL_INTERVAL_S)
        self._turns = asyncio.Semaphore(AT_ONCE)
        self._inside = 0

    async def __call__(self, scope: Any, receive: Any, send: Any) -> None:
        """Pass a request on; refuse an attempt to sign in that is one too many."""
        if (
            scope["type"] != "http"
            or scope["method"] != "POST"
            or not scope["path"].startswith(PATH)
        ):
            await self._inner(scope, receive, send)
            return
        headers = {name: value.decode("latin-1") for name, value in scope["headers"]}
        peer = (scope.get("client") or [""])[0]
        address = resolve_client_address(headers.get(b"x-forwarded-for", ""), peer)
        now_s = self._clock()
        wait_s, places = self._addresses.take(address, now_s), AT_ONCE + MAX_WAITING
        if not wait_s:
            wait_s = self._all.take(now_s)
            if wait_s or self._inside >= places:
                cookies = parse_cookie(headers.get(b"cookie", ""))
                lane = await self._find_lane(cookies, address)
                if lane is not None:
                    wait_s = self._lanes.take(lane, now_s)
                    places += MAX_WAITING_IN_LANES
        if wait_s or self._inside >= places:
            await _refuse(send, headers.get(b"accept-language", ""), int(wait_s) + 1)
            return
        self._inside += 1
        try:
            async with self._turns:
                await self._inner(scope, receive, send)
        finally:
            self._inside -= 1


async def _refuse(send: Any, languages: str, wait_s: int) -> None:
    headers = [
        (b"content-type", b"text/plain; charset=utf-8"),
        (b"retry-after", str(wait_s).encode()),
        (b"cache-control", b"no-store"),
    ]
    await send({"type": "http.response.start", "status": 429, "headers": headers})
    await send({"type": "http.response.body", "body": _words(languages[:100], wait_s)})


@lru_cache(maxsize=256)
def _words(languages: str, wait_s: int) -> bytes:
    """Return what a refused person reads, in a language of the browser."""
    for language, _quality in parse_accept_lang_header(languages):
        try:
            chosen = translation.get_supported_language_variant(language)
        except LookupError:
            continue
        with translation.override(chosen):
            return _refusal(wait_s)
    return _refusal(wait_s)


def _refusal(wait_s: int) -> bytes:
    words = _("Too many attempts to sign in. Wait %(seconds)d seconds, and try again.")
    return (words % {"seconds": wait_s}).encode()
