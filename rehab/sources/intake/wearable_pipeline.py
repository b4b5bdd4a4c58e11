"""Strides by sensors on feet or shanks: times and angles of their own, without an A2."""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Mapping, Sequence

import numpy as np

from rehab.gait import GaitInputError, WearableDetector, WearableStride
from rehab.gait.settings import check_rate
from rehab.gait.signals.clock import SampleClock, estimate_rate
from rehab.gait.signals.frame_clock import FrameClock
from rehab.sources.intake.alignment import Floats
from rehab.sources.intake.settings import Wearable
from rehab.sources.reporting import Notify
from rehab.training.steps import Side

FIRST_SAMPLES = 100  # by which rate and units are checked
RATE_MAX_RAD_S = 35.0  # 2000 °/s, at which common sensors end
ACCELERATION_M_S2 = (7.0, 13.0)  # of half the samples of a walk
CONTACTS = 200  # of a leg that are known: as many as may wait for its sensor's sign
CLOCKS_AGREE_S = 0.010  # from which on contacts of two sensors are compared
LIFT = {
    "foot": "lift the toes of that foot once",
    "shank": "swing that lower leg forward and back once",
}
Sided = tuple[Side, WearableStride, float | None]


class WearablePipeline:
    """Measures the strides of each sensor that is worn.

    Parameters
    ----------
    wearables
        Those that are worn.
    notify
        Called with lines for the person who runs the source.
    """

    def __init__(self, wearables: Sequence[Wearable], notify: Notify) -> None:
        self._sensors = [_Sensor(one, notify) for one in wearables]
        self._contacts: dict[tuple[Side, str], deque[float]] = {
            (one.side, one.place): deque(maxlen=CONTACTS) for one in wearables
        }
        # How well each sensor's times agree with the others' [s]: all are of one device, if nothing
        # else is set.
        self.clock_errors_s: dict[tuple[Side, str], float] = {}

    @property
    def names(self) -> set[str]:
        """Names of the columns that are used."""
        return {name for one in self._sensors for name in one.names}

    def add(self, t_s: Floats, columns: Mapping[str, Floats], frames: Floats | None) -> list[Sided]:
        """Add samples of columns, in the order in which they came; return what they complete.

        Parameters
        ----------
        t_s, columns
            Times [s] and columns as they come, shape (n,); NaN where a sensor has no sample.
        frames
            The samples' numbers by the device's own count, if it has one.

        Returns
        -------
        Strides with their leg, and how unequal the steps of both legs are [%], where both wear a
        sensor in the same place.
        """
        return self._pair([(one, one.add(t_s, columns, frames)) for one in self._sensors])

    def finish(self) -> list[Sided]:
        """Return the strides of samples that are still held back."""
        return self._pair([(one, one.finish()) for one in self._sensors])

    def _pair(self, found: list[tuple[_Sensor, list[WearableStride]]]) -> list[Sided]:
        for sensor, strides in found:
            contacts = self._contacts[sensor.wearable.side, sensor.wearable.place]
            contacts.extend(one.end_s for one in strides)
        return [
            (sensor.wearable.side, stride, self._find_asymmetry(sensor.wearable, stride))
            for sensor, strides in found
            for stride in strides
        ]

    def _find_asymmetry(self, wearable: Wearable, stride: WearableStride) -> float | None:
        """Return by how much the two steps of a stride differ, in percent of the stride."""
        other = next(side for side in Side if side is not wearable.side)
        places = [(side, wearable.place) for side in Side]
        if sum(self.clock_errors_s.get(one, 0.0) for one in places) > CLOCKS_AGREE_S:
            return None
        contacts = self._contacts.get((other, wearable.place), ())
        inside = [at for at in contacts if stride.initial_contact_s < at < stride.end_s]
        if len(inside) != 1:
            return None
        other_s, own_s = inside[0] - stride.initial_contact_s, stride.end_s - inside[0]
        return 100 * abs(own_s - other_s) / stride.stride_s


class _Sensor:
    """One sensor: its clock, its units and its detector."""

    def __init__(self, wearable: Wearable, notify: Notify) -> None:
        self.wearable = wearable
        self.names = [column.name for column in wearable.columns]
        self._notify = notify
        self._where = f"{wearable.side} {wearable.place}"
        self._detector = WearableDetector(wearable.place)
        self._clock: SampleClock | FrameClock | None = None
        self._first: list[Floats] | None = []
        self._is_usable = True
        self._asked = False
        self._left: float | None = None

    def add(
        self, t_s: Floats, columns: Mapping[str, Floats], frames: Floats | None
    ) -> list[WearableStride]:
        """Add samples and return the strides that they complete."""
        if not self._is_usable or not columns.keys() >= set(self.names):
            return []
        wearable = self.wearable
        rows = [columns[one.name] * one.factor for one in wearable.columns]
        table = np.vstack((t_s - wearable.columns[0].delay_s, *rows))
        there = np.isfinite(table).all(axis=0)
        table = table[:, there]
        if not table.shape[1]:
            return []
        if self._first is not None:
            self._first.append(table)
            self._check_first()
        if self._clock is None:
            self._clock = SampleClock() if frames is None else FrameClock()
        if isinstance(self._clock, FrameClock):
            numbers = np.full(len(t_s), math.nan) if frames is None else frames
            return self._feed(self._clock.add(table, 0, numbers[there])[0])
        return self._feed(self._clock.add(table)[0])

    def finish(self) -> list[WearableStride]:
        """Return the strides of samples that are still held back."""
        held = None if self._clock is None else self._clock.finish()
        return [] if held is None else self._feed(held)

    def _feed(self, table: Floats) -> list[WearableStride]:
        acceleration, rate = (table[1:4], table[4:7]) if len(table) == 7 else (None, table[1:])
        strides = self._detector.feed(
            table[0],
            rate[0] if len(rate) == 1 else rate.T,
            None if acceleration is None else acceleration.T,
        )
        self._report()
        return strides

    def _report(self) -> None:
        """Ask whoever is there once, and say once how the sensor is read."""
        detector = self._detector
        if detector.is_in_doubt and not self._asked:
            self._asked = True
            self._notify(
                f"It is not certain how the sensor on the {self._where} is mounted, and no stride "
                "is sent. Let the patient stand still for two seconds, "
                f"{LIFT[self.wearable.place]}, and stand still again."
            )
        if detector.sign != self._left:
            self._left = detector.sign
            if detector.left is not None:
                self._asked = False
                axis = ", ".join(f"{part:z.2f}" for part in detector.left)
                self._notify(f"The sensor on the {self._where} turns about ({axis}), to the left.")

    def _check_first(self) -> None:
        """Check rate and units by the first samples."""
        table = np.concatenate(self._first or [], axis=1)
        if table.shape[1] < FIRST_SAMPLES:
            return
        self._first = None
        try:
            check_rate(estimate_rate(table[0]))
            if len(table) == 7:
                usual = float(np.median(np.linalg.norm(table[1:4], axis=0)))
                if not ACCELERATION_M_S2[0] <= usual <= ACCELERATION_M_S2[1]:
                    raise GaitInputError(
                        f"The acceleration of the {self._where} is {usual:.3g} at rest, not 9.8 "
                        "m/s². Map it with a factor: acc_x*9.81 where the sensor counts in g."
                    )
            if np.abs(table[-1]).max() > RATE_MAX_RAD_S:
                raise GaitInputError(
                    f"The {self._where} turns by {np.abs(table[-1]).max():.0f} rad/s, as no leg "
                    "does. Map the rates with a factor where they are in degrees: gyr_x*0.01745."
                )
        except GaitInputError as problem:
            self._is_usable = False
            self._notify(f"{problem} The sensor is not read. Times are the device's own, seconds.")
