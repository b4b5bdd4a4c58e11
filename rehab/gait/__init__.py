"""From raw signals to strides with A2, while somebody walks. Pure: no Django, no clock."""

from rehab.gait.gyroscope import ContactKind, GyroscopeContact, GyroscopeDetector
from rehab.gait.kinetics import find_ankle_moment, find_ankle_velocity
from rehab.gait.legs import LegSamples, TwoLegDetector
from rehab.gait.offline import measure_both_legs, measure_strides
from rehab.gait.online import StrideDetector
from rehab.gait.selfcheck import Finding, SignalCheck, check_signals
from rehab.gait.strides import Flag, GaitInputError, Reason, Stride

__all__ = [
    "ContactKind",
    "Finding",
    "Flag",
    "GaitInputError",
    "GyroscopeContact",
    "GyroscopeDetector",
    "LegSamples",
    "Reason",
    "SignalCheck",
    "Stride",
    "StrideDetector",
    "TwoLegDetector",
    "check_signals",
    "find_ankle_moment",
    "find_ankle_velocity",
    "measure_both_legs",
    "measure_strides",
]
