"""Strides of one leg while the person walks."""

from __future__ import annotations

from typing import Any

from numpy.typing import ArrayLike

from rehab.gait.detector import Detector
from rehab.gait.one_leg import OneLegStride, OtherLeg
from rehab.gait.stances.plausibility import check_load, check_whole_foot
from rehab.gait.strides import RejectionReason, Stride


class StrideDetector(Detector):
    """Detects the strides of one leg; the settings are those of ``Detector``.

    Parameters
    ----------
    rate_hz, mass_kg, settings
        As in ``Detector``.
    side
        The leg's name in each stride.
    """

    def __init__(
        self, rate_hz: float, mass_kg: float, *, side: str | None = None, **settings: Any
    ) -> None:
        super().__init__(rate_hz, mass_kg, sides=[side], **settings)
        (self._leg,) = self._legs

    def feed(
        self,
        t_s: ArrayLike,
        force_n: ArrayLike,
        moment_nm: ArrayLike,
        angle_rad: ArrayLike,
        forward_n: ArrayLike | None = None,
        position_m: ArrayLike | None = None,
        foot_up_m: ArrayLike | None = None,
        hip_forward_m: ArrayLike | None = None,
        hip_up_m: ArrayLike | None = None,
        knee_angle_rad: ArrayLike | None = None,
        *,
        frame: ArrayLike | None = None,
    ) -> list[Stride]:
        """Add the next samples and return the strides that they complete.

        Parameters
        ----------
        t_s
            Times [s] of the sensors' clock, shape (n,).
        force_n
            Vertical force under the foot [N], upward positive, shape (n,).
        moment_nm, angle_rad
            Ankle moment [Nm] and angle [rad], plantarflexion positive for both, shape (n,); NaN
            where missing.
        forward_n, position_m
            Forward force on the foot [N] and forward position of the foot [m], shape (n,), if there
            are any.
        foot_up_m, hip_forward_m, hip_up_m, knee_angle_rad
            The same place of the foot's height above the floor, the hip's forward position and
            height [m], and the knee's angle [rad, flexion positive], shape (n,), if there are any.
        frame
            The samples' numbers by the device's own count, shape (n,), if it has one
            (``signals.frames``). They may begin in the middle of a walk: the clock then starts
            over.

        Raises
        ------
        GaitInputError
            For channels of different lengths.
        """
        leg = (force_n, moment_nm, angle_rad, forward_n, position_m, foot_up_m)
        return self._feed((t_s, *leg, hip_forward_m, hip_up_m, knee_angle_rad), frame)

    def _detect(self, start: int, stop: int) -> list[Stride]:
        return [self._complete(stride) for stride in self._leg.advance(start, stop)]

    def _complete_last(self) -> list[Stride]:
        return [self._complete(stride) for stride in self._leg.finish()]

    def _complete(self, stride: OneLegStride) -> Stride:
        """Return a stride, its weight checked as far as one plate allows."""
        contact, begin = stride.contact, stride.cycle_index
        reasons: list[RejectionReason] = []
        if self._is_overground:
            reasons = check_whole_foot(contact.peak_n, self._leg.weight_n)
        elif begin is not None:
            load = self._leg.compute_mean_load(begin, contact.begin_index, contact.offset_n)
            reasons = check_load(load)
        return self._leg.complete(stride, OtherLeg(reasons, []))
