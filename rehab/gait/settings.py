"""Settings of a detector, checked, with the cure for those that cannot be used."""

from __future__ import annotations

from dataclasses import dataclass

from rehab.gait.contacts.contact_finder import CONTACT_N, RELEASE_N
from rehab.gait.signals.filters import CUTOFF_HZ
from rehab.gait.strides import GaitInputError

RATE_MIN_HZ, RATE_MAX_HZ = 50.0, 5000.0
RATE_TOLERANCE = 1.01  # 50 Hz by stamps are 49.9
MASS_MIN_KG, MASS_MAX_KG = 10.0, 300.0
LOOK_AHEAD_MAX_S = 0.2


@dataclass(frozen=True, slots=True, kw_only=True)
class DetectorSettings:
    """How strides are detected and measured.

    Attributes
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
    is_overground
        Whether people walk over the plates, a step or two at a time, and not on a treadmill: then
        a stride needs no neighbors, and a foot has to bear its plate whole.

    Raises
    ------
    GaitInputError
        With the cure, for settings that nothing can be measured with.
    """

    rate_hz: float
    mass_kg: float
    look_ahead_s: float = 0.0
    cutoff_hz: float = CUTOFF_HZ
    contact_n: float = CONTACT_N
    release_n: float = RELEASE_N
    is_overground: bool = False

    def __post_init__(self) -> None:
        check_mass(self.mass_kg)
        check_rate(self.rate_hz)
        if not 0 <= self.look_ahead_s <= LOOK_AHEAD_MAX_S:
            raise GaitInputError(
                f"A look-ahead of {self.look_ahead_s:g} s cannot be used. "
                f"Give 0 to {LOOK_AHEAD_MAX_S:g} s."
            )
        if not 1 <= self.cutoff_hz <= self.rate_hz / 5:
            raise GaitInputError(
                f"A cut-off of {self.cutoff_hz:g} Hz cannot be used at {self.rate_hz:g} Hz. Give 1 "
                f"to {self.rate_hz / 5:g} Hz; 6 Hz is the custom."
            )
        if not 0 < self.release_n < self.contact_n:
            raise GaitInputError(
                f"Contact at {self.contact_n:g} N and release at {self.release_n:g} N cannot be "
                "told apart. Give a release above 0 N and a contact above the release."
            )


def check_mass(mass_kg: float | None) -> None:
    """Raise GaitInputError, with the cure, for a body mass [kg] that is missing or impossible."""
    if mass_kg is None or not MASS_MIN_KG <= mass_kg <= MASS_MAX_KG:
        raise GaitInputError(
            f"A body mass of {mass_kg} kg cannot be used. Weigh the patient and give "
            f"{MASS_MIN_KG:g} to {MASS_MAX_KG:g} kg: A2 is power by body mass."
        )


def check_rate(rate_hz: float) -> None:
    """Raise GaitInputError, with the cure, for a rate [Hz] that nothing can be measured at."""
    if not RATE_MIN_HZ / RATE_TOLERANCE <= rate_hz <= RATE_MAX_HZ:
        raise GaitInputError(
            f"A rate of {rate_hz:g} Hz cannot be used. Give the samples' rate, "
            f"{RATE_MIN_HZ:g} to {RATE_MAX_HZ:g} Hz."
        )
