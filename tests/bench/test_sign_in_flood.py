"""The live path while strangers flood the sign-in: a training feels next to nothing of it."""

from __future__ import annotations

import json
import subprocess
import sys
import time
from collections import Counter
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from statistics import median
from typing import Any

import pytest

from tests.bench.driving import BUSY_MS, drive, relay, seed
from tests.support.servers import ROOT, Server, serve

COUNT = 100
RATE = 100  # attempts a second
MAX_RATIO = 2.0
PAIRS = 3  # of a quiet and a flooded block
MIN_PAIRS = 2
PATIENCE_S = 100.0  # after which no further pair begins
FLOOR_S = 2.0
NAMES = ("view_p99_ms", "ack_p99_ms")


@contextmanager
def flood(server: Server, addresses: int) -> Iterator[Counter[str]]:
    """Try to sign in all the time; the answers are counted when the block has ended."""
    answers: Counter[str] = Counter()
    process = subprocess.Popen(
        [
            *(sys.executable, "tests/bench/flood.py", str(server.port)),
            *(f"--rate={RATE}", f"--addresses={addresses}"),
        ],
        cwd=ROOT,
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        text=True,
    )
    try:
        yield answers
        answers.update(json.loads(process.communicate(timeout=90)[0]))
    finally:
        process.kill()
        process.wait()


def floor_p99_ms(file: Path) -> float:
    """Return what a bare relay takes now: by it a busy machine is known."""
    with relay() as (port, pid):
        result = drive("relay", port, pid, file, 1, seconds=FLOOR_S)
    return float(result["view_p99_ms"])


def drive_block(name: str, server: Server, file: Path) -> dict[str, Any]:
    """Run one block; return its times."""
    result = drive("garry", server.port, server.process.pid, file, 1)
    print(
        f"{name}: step→view p50 {result['view_p50_ms']:.1f} p99 {result['view_p99_ms']:.1f} "
        f"max {result['view_max_ms']:.0f} ms; ack p50 {result['ack_p50_ms']:.1f} "
        f"p99 {result['ack_p99_ms']:.1f} ms; {result['us_per_step']:.0f} µs of processor a step; "
        f"RSS {result['rss_mb']:.0f} MB"
    )
    assert result["arrived"] == result["expected"]
    return result


@pytest.mark.parametrize("addresses", [1, 1000])
def test_step_to_screen_while_strangers_try_to_sign_in(tmp_path, addresses):
    """Quiet and flooded in turn, while the machine is quiet itself; the medians are compared."""
    file = tmp_path / "rows.json"
    pairs: list[tuple[dict[str, Any], dict[str, Any]]] = []
    answers: Counter[str] = Counter()
    proxied = {"GARRY_PROXIES": "1"}
    with serve(tmp_path / "data", settings=proxied) as server:
        rows = seed(server, 2 * PAIRS * COUNT)
        blocks = [rows[first : first + COUNT] for first in range(0, len(rows), COUNT)]
        file.write_text(json.dumps(blocks[0]))
        floors, until = [floor_p99_ms(file)], time.monotonic() + PATIENCE_S
        while blocks and time.monotonic() < until:
            file.write_text(json.dumps(blocks.pop()))
            quiet = drive_block("quiet  ", server, file)
            file.write_text(json.dumps(blocks.pop()))
            with flood(server, addresses) as answered:
                flooded = drive_block("flooded", server, file)
            answers += answered
            floors.append(floor_p99_ms(file))
            print(f"relay before and after: p99 {floors[-2]:.1f}, {floors[-1]:.1f} ms")
            if max(floors[-2:]) <= BUSY_MS:
                pairs.append((quiet, flooded))
    print(f"answers from {addresses} address(es): {dict(answers)}")
    assert answers["429"] >= 0.8 * answers.total()
    if len(pairs) < MIN_PAIRS:
        pytest.skip(f"machine too busy: relay p99 {', '.join(f'{f:.1f}' for f in floors)} ms")
    for name in NAMES:
        quiet_ms, flooded_ms = (
            median(block[name] for block in side) for side in zip(*pairs, strict=True)
        )
        ratio = flooded_ms / quiet_ms
        print(f"{name}: quiet {quiet_ms:.1f}, flooded {flooded_ms:.1f} ms: {ratio:.2f} × quiet")
        assert ratio <= MAX_RATIO, name
