"""How a face, arms and a hand act each gesture: looks that follow each other while it is played.

One table for every screen: the avatar's page, a screen on a base's mast, the pages of a session and
the pictures of the twin. Variants of a gesture take the scripts of their act by turns.
"""

from __future__ import annotations

import re
from typing import Any, NamedTuple

EACH_S = 0.4  # how long a look lasts before the next; a script is repeated
HAPPY = -1.0  # eyes that are closed by a smile


class Look(NamedTuple):
    """What a face shows at a moment.

    Parameters
    ----------
    mouth
        calm, smile, laugh, sad, small or wry.
    eyes
        How far they are open, 0 to 1; ``HAPPY`` for arcs.
    brows_deg
        How far the inner ends of the brows are raised [°]; 0 shows none.
    tilt_deg
        Tilt of the head, to its left where positive [°].
    nod
        How far the head is lowered, -1 to 1.
    gaze
        Where the eyes look, -1 to its left and 1 to its right as seen by who stands before it.
    left_deg, right_deg
        Angles of the arms [°]; positive turns clockwise as seen.
    hand_deg
        Angle of a waving hand [°]; None for none.
    """

    mouth: str = "calm"
    eyes: float = 1.0
    brows_deg: float = 0.0
    tilt_deg: float = 0.0
    nod: float = 0.0
    gaze: float = 0.0
    left_deg: float = 0.0
    right_deg: float = 0.0
    hand_deg: float | None = None


# Ends and middle of each mouth's curve (x, y), in the avatar's drawing; a laugh is filled.
MOUTHS = {
    "calm": ((180, 164), (200, 164), (220, 164)),
    "smile": ((172, 160), (200, 180), (228, 160)),
    "laugh": ((166, 154), (200, 204), (234, 154)),
    "sad": ((174, 174), (200, 148), (226, 174)),
    "small": ((191, 166), (200, 170), (209, 166)),
    "wry": ((178, 168), (204, 170), (222, 160)),
}
REST = Look()
Script = tuple[Look, ...]

ACTS: dict[str, tuple[Script, ...]] = {
    "celebrating": (
        (
            Look("laugh", HAPPY, nod=-0.7, left_deg=140, right_deg=-140),
            Look("laugh", HAPPY, nod=0.1, left_deg=100, right_deg=-100),
        ),
        (
            Look("laugh", HAPPY, tilt_deg=-9, nod=-0.4, left_deg=150, right_deg=-20),
            Look("laugh", HAPPY, tilt_deg=9, nod=-0.4, left_deg=20, right_deg=-150),
        ),
        (
            Look("laugh", 1.2, nod=-0.6, left_deg=120, right_deg=-120),
            Look("laugh", HAPPY, nod=-0.2, left_deg=150, right_deg=-150),
        ),
        (
            Look("laugh", HAPPY, tilt_deg=7, nod=-0.6, left_deg=80, right_deg=-80),
            Look("laugh", HAPPY, tilt_deg=-7, nod=-0.1, left_deg=120, right_deg=-120),
            Look("laugh", 1.2, nod=-0.6, left_deg=150, right_deg=-150),
        ),
    ),
    "drooping": (
        (
            Look("sad", 0.6, 20, tilt_deg=8, nod=0.9, left_deg=-8, right_deg=8),
            Look("sad", 0.4, 22, tilt_deg=9, nod=1, left_deg=-8, right_deg=8),
        ),
        (
            Look("sad", 0.5, 22, tilt_deg=-8, nod=0.8, gaze=-0.5, left_deg=-4, right_deg=4),
            Look("sad", 0.2, 24, tilt_deg=-9, nod=1, left_deg=-4, right_deg=4),
        ),
        (
            Look("sad", 0.7, 18, nod=0.7, gaze=0.5, left_deg=-8, right_deg=8),
            Look("sad", 0.3, 24, nod=1, left_deg=-8, right_deg=8),
        ),
    ),
    "trying": (
        (
            Look("wry", 1, 8, tilt_deg=-8, nod=0.2, gaze=0.4, left_deg=35, right_deg=-35),
            Look("wry", 0.7, 8, tilt_deg=-5, nod=0.3, gaze=0.4, left_deg=25, right_deg=-25),
        ),
        (
            Look("small", 1.1, 8, tilt_deg=8, nod=0.2, gaze=-0.4, left_deg=35, right_deg=-35),
            Look("wry", 0.8, 8, tilt_deg=5, nod=0.3, left_deg=25, right_deg=-25),
        ),
        (
            Look("small", 1.1, 6, gaze=0.5, left_deg=60, right_deg=-10),
            Look("wry", 0.9, 8, nod=0.2, left_deg=50, right_deg=-10),
        ),
    ),
    "greeting": (
        (
            Look("smile", 1.1, nod=-0.3, right_deg=-150, hand_deg=-20),
            Look("smile", 1.1, tilt_deg=4, nod=-0.3, right_deg=-120, hand_deg=20),
        ),
        (
            Look("smile", 1.1, tilt_deg=6, right_deg=-150, hand_deg=-25),
            Look("smile", 0.1, tilt_deg=6, right_deg=-120, hand_deg=10),
            Look("smile", 1.1, tilt_deg=3, right_deg=-150, hand_deg=-25),
        ),
    ),
    "leaving": (
        (
            Look("smile", 0.9, tilt_deg=-5, left_deg=150, hand_deg=25),
            Look("smile", 0.1, tilt_deg=-5, nod=0.4, left_deg=120, hand_deg=-10),
        ),
        (
            Look("smile", 0.9, nod=0.2, left_deg=150, hand_deg=15),
            Look("smile", 0.5, nod=0.6, left_deg=130, hand_deg=-15),
        ),
    ),
    "resting": (
        (Look(eyes=0.1, nod=0.3), Look(eyes=0.1, nod=0.5)),
        (Look(eyes=0.3, tilt_deg=6, nod=0.3), Look(eyes=0.1, tilt_deg=7, nod=0.4)),
    ),
    "idling": (
        (REST, REST, Look(eyes=0.1), REST),
        (Look(gaze=0.6), Look(gaze=0.6), Look(eyes=0.1), REST),
        (Look(gaze=-0.6), Look(gaze=-0.6), Look(eyes=0.1), REST),
        (Look(nod=0.15), Look(nod=0.15, eyes=0.1), REST),
    ),
    "nodding": ((Look(nod=0.8), Look(nod=-0.1)),),
    "swaying": (
        (
            Look(tilt_deg=-10, gaze=-0.5, left_deg=25, right_deg=25),
            Look(tilt_deg=10, gaze=0.5, left_deg=-25, right_deg=-25),
        ),
    ),
}
# Which act each pool and built-in gesture is; others follow what they answer.
ACT_OF = {
    "joy": "celebrating",
    "streak_3": "celebrating",
    "streak_5": "celebrating",
    "streak_10": "celebrating",
    "comeback": "celebrating",
    "celebrate": "celebrating",
    "original_positive": "celebrating",
    "disappointment": "drooping",
    "droop": "drooping",
    "original_negative": "drooping",
    "near_miss": "trying",
    "effort": "trying",
    "greeting": "greeting",
    "farewell": "leaving",
    "rest": "resting",
    "idle": "idling",
    "nod": "nodding",
    "sway": "swaying",
}
_NUMBERED = re.compile(r"(.+?)(?:_(\d+))?")


def find_act(gesture: str, *, is_glad: bool | None) -> tuple[str, Script]:
    """Return the act of a gesture, and the script that this variant of it takes.

    Parameters
    ----------
    gesture
        Its name; that of a clinic's own follows ``is_glad``.
    is_glad
        Whether it answers a strong window; only then may it look glad. None for no answer.
    """
    usual = {True: "celebrating", False: "drooping", None: "idling"}[is_glad]
    numbered = _NUMBERED.fullmatch(gesture)
    name, number = (gesture, 1) if numbered is None else (numbered[1], int(numbered[2] or 1))
    act = ACT_OF.get(gesture) or ACT_OF.get(name, usual)
    if act == "celebrating":
        act = usual
    scripts = ACTS[act]
    return act, scripts[(number - 1) % len(scripts)]


def look_at(script: Script, since_s: float) -> Look:
    """Return the look of a script so long after its gesture began [s]."""
    return script[int(max(since_s, 0.0) / EACH_S) % len(script)]


def look_of(gesture: str, mood: str, since_s: float) -> Look:
    """Return the look of a gesture so long after it began [s], by its score's mood."""
    is_glad = {"glad": True, "sad": False}.get(mood)
    return look_at(find_act(gesture, is_glad=is_glad)[1], since_s)


def to_message(look: Look) -> dict[str, Any]:
    """Return a look as a page gets it: its fields, with the mouth's curve as a path of SVG."""
    start, middle, end = (f"{x} {y}" for x, y in MOUTHS[look.mouth])
    return look._asdict() | {"path": f"M{start}Q{middle} {end}"}
