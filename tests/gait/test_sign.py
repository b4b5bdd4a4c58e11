"""With which sign a worn sensor's axis points to the walker's left."""

from types import SimpleNamespace
from typing import Any

import pytest

from rehab.gait import WearableDetector
from rehab.gait.wearables import detector
from rehab.gait.wearables.axis_sign import STRIDES_SURE, find_sign
from tests.support.simulated_leg import walk_foot


def make_readings(quiet, other=1.0, counts=(5, 5), is_plausible=True):
    return [
        SimpleNamespace(sign=sign, count=count, motion_rad_s=motion, is_plausible=is_plausible)
        for sign, count, motion in zip((1.0, -1.0), counts, (quiet, other), strict=True)
    ]


@pytest.mark.parametrize(
    ("quiet", "ahead", "is_sure", "counts", "found"),
    [
        (0.89, 1.0, False, (5, 5), 1.0),  # where travel agrees, a little quieter is enough
        (0.91, 1.0, False, (5, 5), None),
        (0.89, -1.0, True, (5, 5), None),  # travel disagrees
        (0.49, None, True, (5, 5), 1.0),  # alone it has to be half as loud
        (0.51, None, True, (5, 5), None),
        (0.49, None, False, (5, 5), None),  # about an axis that is sure
        (0.49, None, True, (5, 2), None),  # and both signs must be known
        (0.49, 1.0, False, (5, 2), 1.0),
        (0.49, 1.0, False, (4, 4), None),
    ],
)
def test_a_sign_counts_where_the_leg_is_quiet_in_its_stances(quiet, ahead, is_sure, counts, found):
    axis: Any = SimpleNamespace(left_sign=ahead, is_sure=is_sure)
    sign = find_sign(make_readings(quiet, counts=counts), axis)
    assert (sign and sign.sign) == found
    assert find_sign(make_readings(quiet, counts=counts, is_plausible=False), axis) is None


def test_the_sign_is_judged_once_a_stride(monkeypatch):
    looks = []
    monkeypatch.setattr(detector, "find_sign", lambda *given: looks.append(find_sign(*given)))
    one = WearableDetector("foot")
    one.feed(*walk_foot(40))
    assert 20 < len(looks) <= sum(reading.total for reading in one._readings)


def test_a_sign_is_dropped_after_five_looks_in_a_row_that_say_the_other(monkeypatch):
    said = iter([0, *[1] * (STRIDES_SURE - 1), 0, *[1] * STRIDES_SURE])
    signs = []

    def look(readings, _axis):
        signs.append(one.sign)
        place = next(said, None)
        return None if place is None else readings[place]

    monkeypatch.setattr(detector, "find_sign", look)
    one = WearableDetector("foot")
    one.feed(*walk_foot(40))
    assert signs[: 2 * STRIDES_SURE + 2] == [None, *[1.0] * 2 * STRIDES_SURE, None]
