"""Two clinics with a row of each model and a board of both."""

from __future__ import annotations

from collections.abc import Callable

import pytest

from tests.support.world import (
    World,
    build_world,
    fill_board,
)

Worlds = Callable[[], tuple[World, World]]


def build_worlds() -> tuple[World, World]:
    both = build_world("amber"), build_world("birch")
    for world in both:
        fill_board(world)
    return both


@pytest.fixture(scope="class")
def kept_worlds(keep: Callable[..., Worlds]) -> Worlds:
    return keep(build_worlds)


@pytest.fixture
def worlds(kept_worlds: Worlds, db: None) -> tuple[World, World]:
    return kept_worlds()
