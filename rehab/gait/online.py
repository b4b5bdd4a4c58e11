"""Strides of one leg while the person walks."""

from __future__ import annotations

from numpy.typing import ArrayLike

from rehab.gait.contacts.force_plate import CONTACT_N, RELEASE_N
from rehab.gait.one_leg import KEEP_S, LegDetector, OneLegStride, OtherLeg
from rehab.gait.settings import DetectorSettings
from rehab.gait.signals.buffer import SampleBuffer
from rehab.gait.signals.samples import CHANNEL_NAMES, read_chunk, split_chunk
from rehab.gait.stances.kinetics import CUTOFF_HZ
from rehab.gait.stances.plausibility import check_load
from rehab.gait.strides import RejectionReason, Stride


class StrideDetector:
    """Detects the strides of one leg in chunks of samples of any length.

    A stride is complete at its terminal contact, or ``look_ahead_s`` later; its values do not
    depend on how the samples were cut into chunks, bit for bit. Memory does not grow. The detector
    goes on after any samples; strides that cannot be trusted carry reasons.

    Parameters
    ----------
    rate_hz
        Nominal rate of the samples, 50-5000 Hz. Times are measured by the samples' own times.
    mass_kg
        Body mass of the walker, 10-300 kg.
    look_ahead_s
        How long to wait after terminal contact, 0-0.2 s. 50 ms reduce the error of A2 from 1.0 to
        0.14 % (moore2013; the plain zero-phase filter has 1.8 and 0.5 %:
        docs/reference/gait.md#filters).
    cutoff_hz
        Cut-off of the zero-phase low-pass on moment and angle.
    contact_n, release_n
        Force above the plate's zero at which a contact is certain, and at which both of its ends
        are timed [N].
    is_velocity
        Whether ankle velocities [rad/s] are fed instead of angles (gyroscopes).
    side
        The leg's name in each stride.

    Raises
    ------
    GaitInputError
        For settings that nothing can be measured with.
    """

    def __init__(
        self,
        rate_hz: float,
        mass_kg: float,
        *,
        look_ahead_s: float = 0.0,
        cutoff_hz: float = CUTOFF_HZ,
        contact_n: float = CONTACT_N,
        release_n: float = RELEASE_N,
        is_velocity: bool = False,
        side: str | None = None,
    ) -> None:
        settings = DetectorSettings(
            rate_hz=rate_hz,
            mass_kg=mass_kg,
            look_ahead_s=look_ahead_s,
            cutoff_hz=cutoff_hz,
            contact_n=contact_n,
            release_n=release_n,
            is_velocity=is_velocity,
        )
        self._samples = SampleBuffer(int(KEEP_S * rate_hz))
        (buffer,) = self._samples.legs
        self._leg = LegDetector(buffer, settings, side)

    def feed(
        self,
        t_s: ArrayLike,
        force_n: ArrayLike,
        moment_nm: ArrayLike,
        angle_rad: ArrayLike,
        forward_n: ArrayLike | None = None,
        position_m: ArrayLike | None = None,
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

        Raises
        ------
        GaitInputError
            For channels of different lengths.
        """
        channels = (t_s, force_n, moment_nm, angle_rad, forward_n, position_m)
        strides: list[Stride] = []
        for piece, count in split_chunk(
            read_chunk(("t_s", *CHANNEL_NAMES), channels), self._leg.longest_chunk
        ):
            first = self._samples.end
            self._samples.append(piece, count)
            found = self._leg.advance(first, self._samples.end)
            if found:
                strides += [self._complete(stride) for stride in found]
        return strides

    def finish(self) -> list[Stride]:
        """Return the strides that still wait for samples.

        A stance that the end of the samples cuts off is among them, invalid.
        """
        return [self._complete(stride) for stride in self._leg.finish()]

    def _complete(self, stride: OneLegStride) -> Stride:
        """Return a stride, its weight checked as far as one plate allows."""
        contact, begin = stride.contact, stride.cycle_index
        reasons: list[RejectionReason] = []
        if begin is not None:
            load = self._leg.compute_mean_load(begin, contact.begin_index, contact.offset_n)
            reasons = check_load(load)
        return self._leg.complete(stride, OtherLeg(reasons, []))
