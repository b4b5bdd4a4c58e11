"""A real server that is killed and comes back: no stride of the signals is lost."""

import asyncio
import signal

import pytest

pytest.importorskip("django")


@pytest.mark.realtime  # walks twelve seconds in real time
def test_restarts_lose_no_stride(tmp_path):
    from tests.support.server_restarts import walk_with_restarts

    lost, walked, _ = asyncio.run(
        walk_with_restarts(tmp_path, seconds=12, restarts=(3, 8), kill=signal.SIGKILL)
    )

    assert walked > 15
    assert lost == 0
