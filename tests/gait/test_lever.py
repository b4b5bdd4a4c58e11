"""A moment whose lever about the ankle changes as no foot's does."""

import numpy as np
import pytest

from rehab.gait.stances.plausibility import check_lever
from rehab.gait.strides import RejectionReason

FORCE_N = 700 * np.sin(np.linspace(np.pi / 2, np.pi, 50))


@pytest.mark.parametrize(
    ("at_the_end", "is_refused"), [(1.0, False), (0.7, False), (0.3, True), (2.7, True)]
)
def test_a_lever_that_halves_or_doubles_is_another_force_s(at_the_end, is_refused):
    """It is compared where 30 % of the force are left with the moment's peak."""
    lever_m = np.where(0.365 * FORCE_N.max() < FORCE_N, 0.08, 0.08 * at_the_end)
    found = check_lever(FORCE_N, FORCE_N * lever_m, toes=40, weight_n=700)
    assert found == [RejectionReason.MOMENT_OUT_OF_STEP] * is_refused
    assert check_lever(0 * FORCE_N, FORCE_N * lever_m, toes=40, weight_n=700) == []
