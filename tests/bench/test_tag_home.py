"""Home again by a tag, from pictures that the twin's world renders, as a cheap camera takes them.

Blur of the lens, noise, 12 frames a second that come 50 to 150 ms late; what is taken while the
base moves is a smeared picture of where it stood before, so that using it would lead astray.
"""

from __future__ import annotations

import math
import random
from collections import Counter
from typing import Any

import numpy as np
import pytest

pytest.importorskip("pybullet", reason="pybullet is not installed")
pytest.importorskip("cv2", reason="pip install garry[tag]")
import cv2

from robot.bases.twin.tag_view import TagView
from robot.behavior.manual_drive import HOLDS_S, SPEED_M_S
from robot.homing.detector import find_tags, make_detector
from robot.homing.still_frames import FRAMES
from robot.motion.pose import HOME
from tests.support.tag_room import HomingStage, TagRoom, find_start

PLACES = 24
# Noise of a webcam in a room's light [of 255], the blur of its lens, and that of a motion [px].
NOISE, LENS_PX, SMEAR_PX = 4.0, 0.7, 25
WITHIN_M, WITHIN_DEG = 0.02, 2.0


class Pictures:
    """Takes pictures of the twin's room, and finds the tags in them."""

    def __init__(self, seed: int, view: TagView) -> None:
        self._view, self._detector = view, make_detector()
        self._noise = np.random.default_rng(seed)
        self._last = self._stood = HOME
        self._picture: Any = None

    def see(self, pose):
        """Return the tags of a picture from a pose."""
        moves = pose.distance_m(self._last) > 1e-4 or pose.turn_rad(self._last) > 1e-3
        self._last = pose
        if self._picture is None or (not moves and pose != self._stood):
            self._picture = cv2.GaussianBlur(self._view.picture(pose), (0, 0), LENS_PX)
            self._stood = pose
        picture = cv2.blur(self._picture, (SMEAR_PX, 1)) if moves else self._picture
        noisy = picture.astype(float) + self._noise.normal(0.0, NOISE, picture.shape)
        return find_tags(self._detector, np.clip(noisy, 0, 255).astype(np.uint8))


@pytest.fixture(scope="module")
def view():
    return TagView(7)


def test_corners_in_pictures(view):
    """How far the corners that are found are from those that geometry has."""
    room, chance, stray, off = TagRoom(), random.Random(1), [], []
    for number in range(12):
        pose = HOME if number == 0 else find_start(room, chance)
        true = None
        for step in range(36):
            turned = type(pose)(pose.x_m, pose.y_m, math.radians(10 * step))
            if number == 0:
                turned = HOME
            true = room.corners(turned)
            if true is not None:
                break
        pictures = Pictures(number, view)
        pictures.see(turned)
        found = np.array([dict(pictures.see(turned))[7] for _ in range(FRAMES)])
        stray.append(found.std(axis=0).mean())
        mean = found.mean(axis=0) - true
        off.append((mean - mean.mean(axis=0)).std())
    print(f"\nCorners stray by {np.median(stray):.2f} px (most {max(stray):.2f}); the mean of")
    print(f"{FRAMES} is off by {np.median(off):.2f} px (most {max(off):.2f}), beside a shift.")
    assert max(off) < 0.6


def test_it_comes_home(view):
    """From many places, with the whole robot's program: how near, how long, how many looks."""
    room, chance, rows, ends = TagRoom(), random.Random(36), [], Counter[str]()
    for number in range(PLACES):
        moved = find_start(room, chance)
        stage = HomingStage(moved, seed=number, room=room)
        stage.eye.see = Pictures(number, view).see
        began_s = stage.now_s
        code = stage.go_home()
        took_s = stage.now_s - began_s
        stage.wait(1.0)
        there = stage.truth
        ends[code] += 1
        assert min(twist.v_m_s for twist in stage.ordered) >= 0
        rows.append(
            (code, took_s, 1000 * there.distance_m(HOME), math.degrees(there.turn_rad(HOME)))
        )
        print(f"{number:3} {moved} {rows[-1]}", flush=True)
    home = [row for row in rows if row[0] == "there"]
    for name, column in (("s", 1), ("mm", 2), ("°", 3)):
        values = sorted(row[column] for row in home)
        print(f"{name}: median {values[len(values) // 2]:.1f}, most {values[-1]:.1f}")
    print(dict(ends))
    assert len(home) >= 0.9 * PLACES
    assert max(row[2] for row in home) <= 1000 * WITHIN_M
    assert max(row[3] for row in home) <= WITHIN_DEG


def test_it_stands_soon_after_the_button_is_let_go(view):
    """Let go at any moment of its way: how far it still goes."""
    ways = []
    for number in range(6):
        stage = HomingStage(find_start(TagRoom(), random.Random(number)), seed=number)
        stage.eye.see = Pictures(number, view).see
        stage.hold(2.0 + 2.3 * number)
        before = stage.truth
        stage.wait(3.0)
        ways.append(stage.truth.distance_m(before))
        after = stage.truth
        stage.wait(5.0)
        assert stage.truth == after
    print(f"\nAfter the button was let go it went {1000 * max(ways):.0f} mm at most.")
    assert max(ways) <= SPEED_M_S * (HOLDS_S + 0.4)
