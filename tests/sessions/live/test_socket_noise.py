"""Whatever is sent to a socket: it is told so, and whoever walks beside it notices nothing."""

from __future__ import annotations

import pytest

from tests.support.socket_noise import run_noise


# tests/bench has 10,000.
@pytest.mark.wide
@pytest.mark.parametrize("frames", [40, pytest.param(240, marks=pytest.mark.long)])
async def test_noise_on_every_socket_harms_nobody(live_path, capsys, frames):
    told = await run_noise(frames)
    with capsys.disabled():
        print(f"\nSocket noise: {told}")
