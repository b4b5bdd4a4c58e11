"""Which leg a plate's force is of: by the ankle that is over it, and lower."""

from __future__ import annotations

import numpy as np
import pytest

from rehab.gait.recordings.plates import assign_plates

N = 400
CORNERS_MM = np.array(
    [[[0, 0], [400, 0], [400, 600], [0, 600]], [[450, 0], [850, 0], [850, 600], [450, 600]]]
)


def stand(*contacts: tuple[int, int], swing_n: float = 0.0) -> np.ndarray:
    """Return a plate's force: 700 N in contacts, else what it reads unloaded."""
    up_n = np.full(N, swing_n)
    for first, stop in contacts:
        up_n[first:stop] = 700.0
    return up_n


def ankle(x_mm: float, height_mm: float = 80.0) -> np.ndarray:
    """Return a marker that stays where it is."""
    return np.repeat([[x_mm], [300.0], [height_mm]], N, axis=1)


def test_each_plate_is_the_legs_that_stands_on_it_with_what_it_reads_in_swing() -> None:
    left_n, right_n = stand((50, 150), (250, 350), swing_n=4.0), stand((100, 200), swing_n=-3.0)
    forces, unknown = assign_plates(
        np.array([[left_n], [right_n]]), CORNERS_MM, {"left": ankle(200), "right": ankle(650)}
    )
    assert unknown == 0
    assert forces["left"][0] == pytest.approx(left_n)
    assert forces["right"][0] == pytest.approx(right_n)


def test_legs_that_step_on_one_plate_in_turn_have_their_own_contacts_of_it() -> None:
    both_n = stand((50, 150), (250, 350), swing_n=4.0)
    right = ankle(200, height_mm=80.0)
    right[2, :200] = 180.0  # swings by first
    left = ankle(200, height_mm=80.0)
    left[2, 200:] = 180.0
    forces, unknown = assign_plates(
        np.array([[both_n]]), CORNERS_MM[:1], {"left": left, "right": right}
    )
    assert unknown == 0
    assert forces["left"][0] == pytest.approx(stand((50, 150)))
    assert forces["right"][0] == pytest.approx(stand((250, 350)))


@pytest.mark.parametrize(
    "ankles",
    [{"left": ankle(200), "right": ankle(210)}, {"left": ankle(2000)}],
    ids=["both", "none"],
)
def test_a_contact_of_both_legs_or_of_neither_is_nobodys(ankles: dict[str, np.ndarray]) -> None:
    forces, unknown = assign_plates(np.array([[stand((50, 150))]]), CORNERS_MM[:1], ankles)
    assert unknown == 1
    assert not any(force_n.any() for force_n in forces.values())


def test_what_never_bears_a_step_is_no_contact() -> None:
    touched_n = np.where(stand((50, 150)) > 0, 140.0, 0.0)
    forces, unknown = assign_plates(np.array([[touched_n]]), CORNERS_MM[:1], {"left": ankle(200)})
    assert (unknown, forces["left"].max()) == (0, 0.0)
