"""A session's order to its robot, read from what the server sends."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from robot.wire.cue_limits import (
    COUNT_MAX,
    DEFAULT_COUNT,
    DEFAULT_REST_S,
    DEFAULT_THRESHOLD,
    DEFAULT_WINDOW_S,
    REST_MAX_S,
    SEED_MAX,
    THRESHOLD_MAX,
    WINDOW_MAX_S,
    WINDOW_MIN_S,
    CueRule,
)
from robot.wire.frames import BadFrame, read_number, read_whole
from robot.wire.limits import MAX_CUE_GESTURES, MAX_NAME_CHARS

MIN_INTENSITY = 0.1
# A cue of this intensity or less is performed quietly: without sounds, and at this share of the
# limits at most, so that half as far takes as long (our choice).
QUIET = 0.5
QUIET_PACE = 0.5


@dataclass(frozen=True, slots=True)
class Cue:
    """A session's order to its robot.

    Parameters
    ----------
    above, below
        The gesture after a window above or below the threshold; None for none.
    threshold
        Performance that a window's mean, or each step of a streak, has to reach; 1 is the goal.
    rule, count
        What a gesture answers; and how many steps that are, but for windows.
    window_s, rest_s
        Length of a window, and time from the start of one gesture to the start of the next, both
        on the source's clock [s], so that what a robot does follows from the log.
    intensity
        Share of a gesture's size, 0.1 to 1; 0 for no gesture at all.
    only_informs
        Whether the feedback judges nothing, as explicit feedback: then no gesture answers, whatever
        ``above`` and ``below`` name.
    idles
        Whether it may move a little between answers, too.
    seed
        What varied answers follow from; None for the session's number.
    gestures
        Composed gestures as JSON data, not parsed yet.
    """

    above: str | None = None
    below: str | None = None
    threshold: float = DEFAULT_THRESHOLD
    rule: CueRule = CueRule.WINDOWS
    count: int = DEFAULT_COUNT
    window_s: float = DEFAULT_WINDOW_S
    rest_s: float = DEFAULT_REST_S
    intensity: float = 1.0
    only_informs: bool = False
    idles: bool = False
    seed: int | None = None
    gestures: tuple[Any, ...] = ()

    @classmethod
    def read(cls, cue: Any) -> Cue:
        """Return the cue that the server sends. Raises BadFrame."""
        if not isinstance(cue, dict):
            raise BadFrame('"cue" is an object.')
        intensity = read_number(cue, "intensity", 0.0, 1.0)
        if 0 < intensity < MIN_INTENSITY:
            raise BadFrame(f'"intensity" is 0, or a number from {MIN_INTENSITY:g} to 1.')
        # A server from before there were rules names none.
        if (rule := cue.get("rule", CueRule.WINDOWS)) not in list(CueRule):
            raise BadFrame(f'"rule" is one of: {", ".join(CueRule)}.')
        count = DEFAULT_COUNT
        if "count" in cue:
            count = read_whole(cue, "count", low=1, high=COUNT_MAX)
        seed = cue.get("seed")
        if seed is not None:
            seed = read_whole(cue, "seed", low=0, high=SEED_MAX)
        gestures = cue.get("gestures", [])
        for name in ("only_informs", "idles"):
            if not isinstance(cue.get(name, False), bool):
                raise BadFrame(f'"{name}" is true or false.')
        if not isinstance(gestures, list) or len(gestures) > MAX_CUE_GESTURES:
            raise BadFrame(f'"gestures" is a list of up to {MAX_CUE_GESTURES}.')
        return cls(
            above=_read_gesture(cue, "above"),
            below=_read_gesture(cue, "below"),
            threshold=read_number(cue, "threshold", 0.0, THRESHOLD_MAX),
            rule=CueRule(rule),
            count=count,
            window_s=read_number(cue, "window_s", WINDOW_MIN_S, WINDOW_MAX_S),
            rest_s=read_number(cue, "rest_s", 0.0, REST_MAX_S),
            intensity=intensity,
            only_informs=cue.get("only_informs", False),
            idles=cue.get("idles", False),
            seed=seed,
            gestures=tuple(gestures),
        )

    @property
    def is_quiet(self) -> bool:
        """Whether it is to be performed without sounds, and slowly."""
        return self.intensity <= QUIET

    @property
    def pace(self) -> float:
        """The share of the limits at which it is performed at most."""
        return QUIET_PACE if self.is_quiet else 1.0

    @property
    def moves(self) -> bool:
        """Whether any gesture may answer."""
        return self.intensity > 0 and not self.only_informs

    def gesture(self, above: bool) -> str | None:
        """Return the gesture after a window above or below the threshold."""
        return self.above if above else self.below


def _read_gesture(cue: Mapping[str, Any], name: str) -> str | None:
    gesture = cue.get(name)
    if gesture is not None and not (
        isinstance(gesture, str) and 0 < len(gesture) <= MAX_NAME_CHARS
    ):
        raise BadFrame(f'"{name}" is the name of a gesture, or null.')
    return gesture
