"""Ten thousand malformed forms, and as many frames: no failure, no leak, no growth."""

from __future__ import annotations

import gc

import psutil
import pytest

from tests.sessions.live.conftest import live_path  # noqa: F401 (a fixture)
from tests.support import form_noise, socket_noise
from tests.support.noise import draw

COUNT = 10_000
WARM = 1_000  # requests after which caches are full
GROWTH_MAX_MB = 30.0  # of a process, over all that comes after those


def used_mb() -> float:
    """Return the memory of this process."""
    gc.collect()
    return float(psutil.Process().memory_info().rss / 2**20)


@pytest.mark.django_db
def test_ten_thousand_malformed_forms():
    inspector = form_noise.Inspector()
    noises = draw(form_noise.make_noise(), COUNT)
    inspector.look(noises[:WARM])
    before = used_mb()
    inspector.look(noises[WARM:])
    grown = used_mb() - before
    print(f"\nForm noise: {inspector.tell()}")
    print(f"Memory: {before:.0f} MB, and {grown:+.1f} MB over {COUNT - WARM} requests")
    assert grown < GROWTH_MAX_MB


async def test_ten_thousand_malformed_frames(live_path):  # noqa: F811
    ward = await socket_noise.Ward.build()
    noises = draw(socket_noise.make_noise(), COUNT)
    await ward.hold_out(noises[:WARM])
    before = used_mb()
    await ward.hold_out(noises[WARM:])
    grown = used_mb() - before
    print(f"\nSocket noise: {ward.tell()}")
    print(f"Memory: {before:.0f} MB, and {grown:+.1f} MB over {COUNT - WARM} frames")
    assert grown < GROWTH_MAX_MB
