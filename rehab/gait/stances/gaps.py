"""Gaps in the time base of a stance: late and lost samples, and the clock of each channel."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from rehab.gait.signals.filters import Floats, find_maximum
from rehab.gait.signals.samples import ANGLE, MOMENT, TIME
from rehab.gait.strides import Flag, RejectionReason

# Stalls before do no harm: 10.6 % rms between neighbors against 11.6 % without a stall, and 16 to
# 31 % after (docs/reference/gait.md#time-base).
HARMFUL_FROM = 0.55  # of stance
LATE_SAMPLE_S = 0.01
GAP_S = 0.05  # bridged by a straight line up to here (docs/reference/gait.md#time-base)
GAP_MAX_S = 0.25  # before 55 % of stance; the filter settles in 0.15 s
# Around late samples a curve of fourth order is drawn through moment and angle, by stamp and by
# sample number; the smoother one is how the channel was made. On moore2013 inverse dynamics is by
# stamp: 3 to 10 times as smooth.
AROUND_S, AROUND_SAMPLES = 0.08, 8
ORDER = 4
CERTAIN = 1.0  # of the sum of the logarithms of ratios
MOST = 3.0  # that one stall may add to it


@dataclass(slots=True)
class StanceClock:
    """The clock of a stance.

    Attributes
    ----------
    kinetics_s
        When moment and angle were measured [s], shape (n,), as the samples of the stance.
    taken_s
        From the first to the last sample of the stance [s].
    bridged_s
        Longest time between two samples that a straight line bridges where that harms A2 [s].
    late_s, lost_s
        As in ``Stride``.
    reasons, flags
        What they do to the stride.
    """

    kinetics_s: Floats
    taken_s: float
    bridged_s: float
    late_s: float
    lost_s: float
    reasons: list[RejectionReason]
    flags: list[Flag]


class ClockJudge:
    """Decides by which clock moment and angle of one leg are made, and which strides that harms.

    Forces and markers are sampled evenly. Inverse dynamics that runs by the stamps (HBM) takes a
    late sample for a slow motion: what it then computes is wrong, and no clock makes it right.
    """

    def __init__(self, rate_hz: float) -> None:
        self._rate_hz = rate_hz
        self._around = max(AROUND_SAMPLES, round(AROUND_S * rate_hz))
        self._by_number = 0.0  # evidence for it; below 0 against

    def judge(
        self,
        window: Floats,
        late_s: Floats | None,
        stance: int,
        critical: int,
    ) -> StanceClock:
        """Return the clock of a stance.

        Parameters
        ----------
        window
            Shape (channels, n): time, force, moment, angle, …
        late_s
            By how much each sample came late [s], shape (n,), or None.
        stance, critical
            The samples at which the stance begins, and from which a fault harms A2.
        """
        time = window[TIME]
        reasons: list[RejectionReason] = []
        flags: list[Flag] = []
        first = max(0, stance - 1)
        steps_s = time[first + 1 :] - time[first:-1]
        longest_s = find_maximum(steps_s)
        bridged_s = _find_longest(steps_s[critical - 1 - first :])
        taken_s = time.item(-1) - time.item(stance)
        lost_s = max(0.0, longest_s - 1 / self._rate_hz)
        least_s = max(GAP_S, 2.5 / self._rate_hz)
        if longest_s > least_s:
            is_harmful = (
                steps_s[0] > least_s  # it hides the initial contact
                or longest_s > GAP_MAX_S
                or bridged_s > least_s
            )
            if is_harmful:
                reasons.append(RejectionReason.GAP)
            else:
                flags.append(Flag.LOST)
        if late_s is None:
            return StanceClock(time, taken_s, bridged_s, 0.0, lost_s, reasons, flags)
        self._weigh(window, late_s)
        is_by_number = self._by_number > CERTAIN
        latest_s = float(late_s[stance:].max(initial=0.0))
        if late_s[critical:].max(initial=0.0) > LATE_SAMPLE_S and not is_by_number:
            reasons.append(RejectionReason.LATE)
        elif latest_s > LATE_SAMPLE_S:
            flags.append(Flag.LATE)
        kinetics_s = time
        if not is_by_number:
            kinetics_s = time + late_s
            bridged_s = _find_longest(np.diff(kinetics_s[critical - 1 :]))
        return StanceClock(kinetics_s, taken_s, bridged_s, latest_s, lost_s, reasons, flags)

    def _weigh(self, window: Floats, late_s: Floats) -> None:
        """Add the evidence of this stance's late samples on how its moment and angle are made."""
        is_late = np.concatenate(([False], late_s > LATE_SAMPLE_S / 2, [False]))
        edges = np.flatnonzero(is_late[1:] != is_late[:-1]).reshape(-1, 2)
        for first, last in edges:
            part = slice(max(0, first - self._around), last + self._around)
            time = window[TIME, part]
            stamps = time + late_s[part]
            known = np.isfinite(window[MOMENT : ANGLE + 1, part]).all(axis=0)
            if known.sum() < 3 * ORDER or first == 0:
                continue
            rows = window[MOMENT : ANGLE + 1, part][:, known]
            by_number, by_stamp = (_find_roughness(t[known], rows) for t in (time, stamps))
            ratios = np.log((by_stamp + 1e-12) / (by_number + 1e-12))
            evidence = float(np.clip(ratios, -MOST, MOST).sum()) / 2
            if math.isfinite(evidence):
                self._by_number = min(MOST, max(-MOST, self._by_number + evidence))


def _find_longest(steps_s: Floats) -> float:
    return find_maximum(steps_s) if len(steps_s) else 0.0


def _find_roughness(time: Floats, rows: Floats) -> Floats:
    """Return the rms distance of each row from its own smooth curve over time."""
    centered = time - time.mean()
    basis = np.vander(centered / max(1e-9, float(np.abs(centered).max())), ORDER + 1)
    fitted = basis @ np.linalg.lstsq(basis, rows.T, rcond=None)[0]
    rms: Floats = np.sqrt(((rows.T - fitted) ** 2).mean(axis=0))
    return rms
