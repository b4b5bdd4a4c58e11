"""Whatever is sent to a socket: it is told so, and whoever walks beside it notices nothing."""

from __future__ import annotations

from tests.support.socket_noise import run_noise

FRAMES = 240  # tests/bench has 10,000


async def test_noise_on_every_socket_harms_nobody(live_path, capsys):
    told = await run_noise(FRAMES)
    with capsys.disabled():
        print(f"\nSocket noise: {told}")
