"""Strides with A2 from raw signals, while a person walks. Pure: no Django, no clock.

``StrideDetector`` and ``TwoLegDetector`` take samples as they come, ``measure_strides`` a whole
recording with the same code, ``WearableDetector`` those of a sensor on a foot or shank. Comments
name the source of each threshold.
"""

from rehab.gait.offline import make_detector, measure_strides
from rehab.gait.online import StrideDetector
from rehab.gait.selfcheck.checks import Finding, SignalCheck, check_signals
from rehab.gait.signals.samples import LegSamples
from rehab.gait.stances.kinetics import compute_ankle_moment
from rehab.gait.strides import Flag, GaitInputError, RejectionReason, Stride
from rehab.gait.two_legs import TwoLegDetector
from rehab.gait.wearables.detector import WearableDetector
from rehab.gait.wearables.strides import WearableStride

__all__ = [
    "Finding",
    "Flag",
    "GaitInputError",
    "LegSamples",
    "RejectionReason",
    "SignalCheck",
    "Stride",
    "StrideDetector",
    "TwoLegDetector",
    "WearableDetector",
    "WearableStride",
    "check_signals",
    "compute_ankle_moment",
    "make_detector",
    "measure_strides",
]
