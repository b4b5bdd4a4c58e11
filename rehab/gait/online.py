"""Strides of one leg while the person walks."""

from __future__ import annotations

import math
from collections import deque

from numpy.typing import ArrayLike

from rehab.gait.contacts import CONTACT_N, RELEASE_N, Contact, ContactFinder
from rehab.gait.filters import Floats
from rehab.gait.kinetics import CUTOFF_HZ
from rehab.gait.plausibility import STANCE_MAX_S, STANCE_MIN_S
from rehab.gait.samples import TIME, SampleBuffer, read_chunk
from rehab.gait.settings import check_settings
from rehab.gait.stances import StanceMeter
from rehab.gait.strides import Flag, Reason, Stride

GRAVITY_M_S2 = 9.81
KEEP_S = 8.0  # the longest cycle, the longest stance after it, and the piece they came in
PIECE_S = 1.0  # of a long chunk is taken at a time
STRIDE_MAX_S = 4.0
LONGEST_GAP_S = 0.25  # in a cycle; longer ones may hide a contact
OFFSET_N = 15.0
# A leg that never bears 80 % of the weight has help: even slow walking reaches 95 %.
FULL_LOAD = 0.8
USUAL_STANCES = 9
USUAL_MIN, USUAL_MAX = 0.6, 1.5  # of the median of the last stances


class StrideDetector:
    """Finds the strides of one leg in chunks of samples of any length.

    A stride is given at its terminal contact, or ``look_ahead_s`` later; what it holds does not
    depend on how the samples were cut into chunks, bit for bit. Memory does not grow. Whatever is
    fed, the detector goes on; strides that cannot be trusted carry reasons.

    Parameters
    ----------
    rate_hz
        Nominal rate of the samples, 50-5000 Hz. Their own times count.
    mass_kg
        Of the walker, 10-300 kg.
    look_ahead_s
        How long to wait after terminal contact, 0-0.2 s. 50 ms take the error of A2 from 1.0 to
        0.14 % (moore2013).
    cutoff_hz
        Of the zero-phase low-pass on moment and angle.
    contact_n, release_n
        Force above the plate's zero at which a contact is sure, and at which both ends are timed.
    is_velocity
        Whether ankle velocities [rad/s] are fed instead of angles (gyroscopes).
    side
        Named in each stride.

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
        check_settings(rate_hz, mass_kg, look_ahead_s, cutoff_hz, contact_n, release_n)
        self.rate_hz = float(rate_hz)
        self.mass_kg = float(mass_kg)
        self.weight_n = self.mass_kg * GRAVITY_M_S2
        self.side = side
        self.buffer = SampleBuffer(int(KEEP_S * rate_hz))
        self.piece = int(PIECE_S * rate_hz)
        self.contacts = ContactFinder(self.buffer, rate_hz, self.weight_n, contact_n, release_n)
        self._meter = StanceMeter(
            self.buffer, self.rate_hz, self.mass_kg, self.weight_n, cutoff_hz, is_velocity
        )
        self._wait = math.ceil(look_ahead_s * rate_hz - 1e-9)
        self._pending: deque[Contact] = deque()
        self._previous: Contact | None = None  # the stance before, with its bounces
        self._left: tuple[int, float] | None = None  # where it really ended
        self._stances: deque[float] = deque(maxlen=USUAL_STANCES)
        self._number = 0

    def feed(
        self,
        t_s: ArrayLike,
        force_n: ArrayLike,
        moment_nm: ArrayLike,
        angle_rad: ArrayLike,
        forward_n: ArrayLike | None = None,
        position_m: ArrayLike | None = None,
    ) -> list[Stride]:
        """Take the next samples; give the strides that they complete.

        Parameters
        ----------
        t_s
            Times [s] of the sensors' clock, shape (n,).
        force_n
            Vertical force under the foot [N], upward positive.
        moment_nm, angle_rad
            Ankle moment [Nm] and angle [rad], plantarflexion positive for both; NaN where missing.
        forward_n, position_m
            Forward force on the foot [N] and forward position of the foot [m], if there are any.

        Raises
        ------
        GaitInputError
            For channels of different lengths.
        """
        chunk = read_chunk(t_s, force_n, moment_nm, angle_rad, forward_n, position_m)
        length = 0 if chunk[0] is None else len(chunk[0])
        strides: list[Stride] = []
        for start in range(0, length, self.piece):
            found = self.take(chunk, start, min(length, start + self.piece))
            strides += [stride for _, stride, _ in found]
        return strides

    def finish(self) -> list[Stride]:
        """Give the strides that still wait for samples after their terminal contact."""
        return [stride for stride, _ in self.take_rest()]

    def take_rest(self) -> list[tuple[Stride, Contact]]:
        """Give the strides that still wait, with their contacts."""
        strides = []
        while self._pending:
            contact = self._pending.popleft()
            if self._settle(contact):
                strides.append((self._measure(contact, self.buffer.end), contact))
        return strides

    def take(
        self, chunk: list[Floats | None], start: int, stop: int
    ) -> list[tuple[int, Stride, Contact]]:
        """Take samples ``start:stop`` of a chunk, a second at most.

        Gives each stride with the index of the sample that completed it, and its contact.
        """
        first = self.buffer.end
        self.buffer.append(chunk, start, stop)
        ended = self.contacts.advance(first, self.buffer.end)
        if ended:
            self._pending.extend(ended)
        strides = []
        while self._pending:
            due = (self._pending[0].end_index or 0) + self._wait
            if due >= self.buffer.end:
                break
            contact = self._pending.popleft()
            if self._settle(contact):
                strides.append((due, self._measure(contact, due + 1), contact))
        return strides

    def _settle(self, contact: Contact) -> bool:
        """Say whether a contact is a stance to be told; remember it if not."""
        is_cut = contact.begin_index == 0  # the record began in the middle of it
        if is_cut or contact.bounce:
            self._previous = None if is_cut else self._previous
            self._left = (contact.end_index or 0, contact.end_s or 0.0)
        return not is_cut and not contact.bounce

    def _measure(self, contact: Contact, stop: int) -> Stride:
        """Measure a stance from the samples before ``stop``."""
        begin_s, end_s = contact.begin_s, contact.end_s or 0.0
        stance = self._meter.measure(contact, stop)
        reasons, push_off = stance.reasons, stance.push_off
        stride_s, swing_s = self._find_cycle(contact)
        if self._is_unusual(end_s - begin_s):
            reasons.append(Reason.IRREGULAR)
        flags = [Flag.OFFSET] if abs(contact.offset_n) > OFFSET_N else []
        if contact.peak_n < FULL_LOAD * self.weight_n:
            flags.append(Flag.SUPPORTED)
        self._number += 1
        self._previous, self._left = contact, (contact.end_index or 0, end_s)
        return Stride(
            number=self._number,
            initial_contact_s=begin_s,
            terminal_contact_s=end_s,
            a2_w_kg=push_off.a2_w_kg if push_off else None,
            a2_time_s=push_off.a2_time_s if push_off else None,
            valid=not reasons,
            reasons=tuple(reasons),
            flags=tuple(flags),
            stance_s=end_s - begin_s,
            stride_s=stride_s,
            swing_s=swing_s,
            force_peak_n_kg=contact.peak_n / self.mass_kg,
            moment_peak_nm_kg=push_off.moment_peak_nm_kg if push_off else None,
            a2_moment_nm_kg=push_off.a2_moment_nm_kg if push_off else None,
            a2_velocity_rad_s=push_off.a2_velocity_rad_s if push_off else None,
            propulsion_n_kg=stance.propulsion_n_kg,
            position_m=stance.position_m,
            offset_n=contact.offset_n,
            side=self.side,
        )

    def _find_cycle(self, contact: Contact) -> tuple[float | None, float | None]:
        """Give stride and swing time of the cycle that ended at this contact, where seen whole."""
        if self._previous is None or self._left is None or not contact.seen:
            return None, None
        left_index, left_s = self._left
        begin = self._previous.begin_index
        stride_s = contact.begin_s - self._previous.begin_s
        if contact.begin_index - begin > STRIDE_MAX_S * self.rate_hz or stride_s > STRIDE_MAX_S:
            return None, None
        times = self.buffer.channel(TIME, left_index - 1, contact.begin_index + 1)
        steps = times[1:] - times[:-1]
        if not (stride_s > 0 and steps.min() > 0 and steps.max() <= LONGEST_GAP_S):
            return None, None
        return stride_s, contact.begin_s - left_s

    def _is_unusual(self, stance_s: float) -> bool:
        """Compare a stance with the last ones, of whatever kind, and remember it."""
        usual = sorted(self._stances)[len(self._stances) // 2] if len(self._stances) > 1 else None
        if STANCE_MIN_S <= stance_s <= STANCE_MAX_S:
            self._stances.append(stance_s)
        return usual is not None and not USUAL_MIN < stance_s / usual < USUAL_MAX
