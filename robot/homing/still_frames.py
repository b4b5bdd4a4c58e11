"""A look: some frames in a row that a base took while it stood, and what they say together.

While a base moves, its frames are blurred, and nobody knows exactly when a cheap camera took them:
50 to 150 ms before it delivers them. So it moves by odometry, and looks while it stands.
"""

from __future__ import annotations

import numpy as np

from robot.homing.codes import (
    CAMERA_CHANGED,
    CAMERA_SILENT,
    CAMERA_SLOW,
    NO_TAG,
    TAG_MOVES,
    TWO_TAGS,
)
from robot.homing.sighting import Sighting
from robot.homing.tag_pose import Matrix

# A camera delivers a frame at most so late [s] (docs/reference/kobuki.md#cameras-and-tags): what it
# took before the base stood is left out.
LATENCY_S = 0.25
# A frame older than this [s] moves nothing, and its camera counts as silent.
FRESH_S = 0.5
# The mean of so many frames is what a look sees; 10 to 15 frames a second take 0.8 s for them.
FRAMES = 8
LOOKS_S = 2.5  # a look that has not seen its tag by then has not seen it
# Corners that stray further than this from their mean [px] are those of a tag that moves. (Ours:
# five times what they stray at rest, tests/bench/test_tag_home.py.)
STRAYS_PX = 1.5


class Look:
    """Frames of a standing base.

    Parameters
    ----------
    tag
        The number of the tag to look for.
    size_px
        Width and height of the frames; None for any.
    from_s
        Since when the base has stood [s].
    frames
        How many frames with its tag it takes.

    Attributes
    ----------
    seen
        The numbers of all tags that were in its frames.
    """

    def __init__(
        self, tag: int, size_px: tuple[int, int] | None, from_s: float, frames: int = FRAMES
    ) -> None:
        self._tag, self._size_px, self._from_s, self._wanted = tag, size_px, from_s, frames
        self._lasts_s = LATENCY_S + LOOKS_S * frames / FRAMES
        self._corners: list[Matrix] = []
        self._frames, self._newest_s, self._problem = 0, -np.inf, ""
        self.seen = set[int]()

    def add(self, sighting: Sighting) -> None:
        """Add a frame; one from before the base stood does not count."""
        if sighting.at_s < self._from_s + LATENCY_S or self._problem == TWO_TAGS:
            return
        self._newest_s = sighting.at_s
        self._problem = sighting.problem
        if sighting.problem:
            return
        if self._size_px not in (None, sighting.size_px):
            self._problem = CAMERA_CHANGED
            return
        self._frames += 1
        self.seen |= {number for number, _ in sighting.tags}
        found = sighting.corners_of(self._tag)
        if len(found) > 1:
            self._problem = TWO_TAGS
        elif found:
            self._corners.append(np.array(found[0]))

    def problem(self, now_s: float) -> str:
        """Return why it will see nothing, as a code; empty while it may still, or has."""
        is_over = now_s > self._from_s + self._lasts_s
        if self._problem == TWO_TAGS:
            return TWO_TAGS
        if now_s - max(self._newest_s, self._from_s + LATENCY_S) > FRESH_S:
            return CAMERA_SLOW if self._frames else CAMERA_SILENT
        if self._problem:
            return self._problem
        if self.is_whole and self._strays_px > STRAYS_PX:
            return TAG_MOVES
        if not is_over or self.is_whole:
            return ""
        return NO_TAG if self._frames >= self._wanted else CAMERA_SLOW

    @property
    def has_frames(self) -> bool:
        """Whether its camera has sent any that can be used."""
        return self._frames > 0

    @property
    def is_whole(self) -> bool:
        """Whether it has seen its tag often enough."""
        return len(self._corners) >= self._wanted

    @property
    def corners_px(self) -> Matrix:
        """The mean of the tag's corners (4 × 2) [px]."""
        return np.asarray(np.mean(self._corners, axis=0))

    @property
    def _strays_px(self) -> float:
        """How far the corners stray from their mean, root mean square [px]."""
        off = np.array(self._corners) - self.corners_px
        return float(np.sqrt((off**2).sum(axis=2).mean()))
