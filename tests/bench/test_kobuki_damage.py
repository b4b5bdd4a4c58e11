"""One million damaged frames: what is kept of the others, and what the damaged ones bring about."""

from __future__ import annotations

import random
import time

import pytest

from tests.support import kobuki_damage as damage

pytestmark = pytest.mark.bench

MUTATED = 1_000_000
FRAMES = 200_000


@pytest.mark.parametrize("lose", [damage.lose_bytes, damage.lose_a_byte])
def test_undamaged_frames_are_kept(lose):
    share = damage.keep_share(random.Random(1), FRAMES, lose)
    print(f"\n{lose.__name__}: {share:.2%} of the undamaged among {FRAMES:,} frames kept")
    assert share >= 0.98


def test_a_million_mutated_frames_change_nothing():
    chance, began_s = random.Random(3), time.perf_counter()
    mutated = fooled = 0
    wrong: list[str] = []
    while mutated < MUTATED:
        life = damage.live_through(chance, 100_000)
        mutated, fooled = mutated + life.mutated, fooled + life.fooled_checksum
        wrong += life.wrong
    print(
        f"\n{mutated:,} mutated frames among three times as many, {fooled:,} taken for frames, "
        f"{len(wrong)} wrong beliefs, in {time.perf_counter() - began_s:.0f} s"
    )
    assert wrong == []
