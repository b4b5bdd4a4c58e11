"""A whole set-up checked: what its columns are, and whether they are in time."""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping
from dataclasses import dataclass, replace
from statistics import median

import numpy as np

from rehab.gait.offline import measure_strides
from rehab.gait.recordings.column_mapping import (
    CHANNELS,
    FILTERED_HZ,
    REQUIRED,
    SIGNAL_LAYOUTS,
    ColumnMap,
    SignalColumn,
)
from rehab.gait.recordings.csv_files import apply_columns
from rehab.gait.selfcheck.checks import check_signals
from rehab.gait.selfcheck.lag import find_deceleration_peak
from rehab.gait.setup.find_columns import CERTAIN_LIKE, OWN, Proposal, propose
from rehab.gait.setup.names import read_label
from rehab.gait.setup.own_kinetics import compare_with_own
from rehab.gait.signals.clock import SampleClock
from rehab.gait.signals.filters import Floats
from rehab.gait.signals.samples import LegSamples
from rehab.gait.stances.gaps import LATE_SAMPLE_S
from rehab.gait.stances.lag_watch import find_moment_lag, find_pace
from rehab.gait.strides import GaitInputError, Stride

# Moment and force fall together within 8 ms (five people: ``lag_watch``; simulated: -11 to -3).
MOMENT_TOLERANCE_S = 0.012
SAME_FACTOR = 0.02
STRIDES_MIN = 8


@dataclass(frozen=True, slots=True)
class SetupCheck:
    """What a set-up is found to be.

    Attributes
    ----------
    proposal
        Columns, units, signs, legs, mass.
    columns
        The same as a map to measure with.
    timing_s
        By how much each moment falls later than its force, and how long after its foot has left
        each ankle brakes [s], by side and channel; None where it cannot be told. No delay: people
        differ in the latter by more than any delay that matters.
    late, lost
        Samples that came late, and times without samples.
    strides, valid, a2_w_kg
        Of the recording, measured with this; the median A2 of valid strides by side.
    findings
        What a person should look at, with the cure.
    """

    proposal: Proposal
    columns: ColumnMap
    timing_s: dict[tuple[str, str], float | None]
    late: int
    lost: int
    strides: int
    valid: int
    a2_w_kg: dict[str, float]
    findings: tuple[str, ...]

    @property
    def is_certain(self) -> bool:
        """Whether nothing is left to look at."""
        return not self.findings and all(one.is_certain for one in self.proposal.guesses.values())


def check_setup(
    columns: Mapping[str, Floats],
    mass_kg: float | None = None,
    *,
    is_overground: bool | None = None,
) -> SetupCheck:
    """Return what the columns of a walk are, and whether they are in time.

    Parameters
    ----------
    columns
        By name, shape (n,) each.
    mass_kg, is_overground
        Body mass, and whether it is a few steps over plates, if known.

    Raises
    ------
    GaitInputError
        With the cure, where nothing is recognized.
    """
    proposal = propose(columns, mass_kg, is_overground=is_overground)
    found = _make_map(proposal, columns)
    time_s, legs = apply_columns(columns, found)
    strides = _measure(time_s, legs, proposal)
    timing = {
        (side, channel): _find_timing(channel, time_s, leg, [s for s in strides if s.side == side])
        for side, leg in legs.items()
        for channel in ("moment", "angle")
    }
    a2_w_kg = {
        side: median(values)
        for side in legs
        if (values := [s.a2_w_kg for s in strides if s.side == side and s.valid and s.a2_w_kg])
    }
    (times,), late_s = SampleClock().add(np.array([time_s]))
    late = 0 if late_s is None else int((late_s > LATE_SAMPLE_S).sum())
    lost = int((np.diff(times) > 2.5 / proposal.rate_hz).sum())
    check = check_signals(
        time_s,
        legs.get("left"),
        legs.get("right"),
        rate_hz=proposal.rate_hz,
        mass_kg=proposal.mass_kg,
        strides=strides,
        is_overground=proposal.is_overground,
    )
    findings = (
        list(proposal.notes)
        + _describe_own(proposal)
        + [f"{guess.column}: {guess.doubt}." for guess in proposal.guesses.values() if guess.doubt]
    )
    pace = find_pace(median([stride.stance_s for stride in strides] or [0.0]))
    findings += _describe_missing(proposal) + _describe_timing(timing, MOMENT_TOLERANCE_S * pace)
    unlike = compare_with_own(columns, time_s, legs, strides)
    for key, text in unlike.items():  # what their curve and label say is then not sure
        proposal.guesses[key] = replace(proposal.guesses[key], doubt=text)
    findings += unlike.values()
    findings += [
        f"{one.side.capitalize()} leg: {one.message}" if one.side else one.message
        for one in check.findings
    ]
    return SetupCheck(
        proposal=proposal,
        columns=found,
        timing_s=timing,
        late=late,
        lost=lost,
        strides=len(strides),
        valid=sum(stride.valid for stride in strides),
        a2_w_kg=a2_w_kg,
        findings=tuple(dict.fromkeys(findings)),
    )


def compare_with_setup(check: SetupCheck, columns: ColumnMap) -> list[str]:
    """Return what a person's map of columns has wrong, with what was seen; empty if nothing.

    Only what is certain contradicts a person.
    """
    wrong = []
    if columns.time.name != check.proposal.time:
        wrong.append(f"The time is {check.proposal.time}, not {columns.time.name}.")
    for side, leg in columns.legs.items():
        for channel, column in leg.items():
            guess = check.proposal.guesses.get((side, channel))
            if guess is None:
                continue
            what = f"{side}.{channel}={column.name}"
            is_alike = guess.likeness > CERTAIN_LIKE
            is_clear = is_alike and not guess.doubt
            if guess.column != column.name:
                label = read_label(column.name)
                is_named = label and label.channel == channel and label.side in {"", side}
                # A doubt about the unit or sign of a labelled column is none about the column.
                is_this = is_clear or (is_alike and guess.is_named)
                if guess.is_certain or (is_this and not is_named):
                    wrong.append(f"{what}: {guess.column} looks like it, {column.name} does not.")
            elif guess.factor * column.factor < 0 and is_alike:
                wrong.append(f"{what}: its sign is turned. Give a factor of {guess.factor:.6g}.")
            elif abs(column.factor / guess.factor - 1) > SAME_FACTOR and is_clear:
                wrong.append(
                    f"{what}: it is in {guess.unit}. Give a factor of {guess.factor:.6g}, "
                    f"not {column.factor:.6g}."
                )
    return wrong


def _make_map(proposal: Proposal, columns: Collection[str]) -> ColumnMap:
    """Return what is proposed as a map, and what plates and markers came to beside it."""
    legs: dict[str, dict[str, SignalColumn]] = {}
    for (side, channel), guess in proposal.guesses.items():
        legs.setdefault(side, {})[channel] = SignalColumn(guess.column, guess.factor)
    whole = {side: leg for side, leg in legs.items() if leg.keys() >= set(REQUIRED)}
    if not whole:
        seen = ", ".join(f"{s} {c} {g.column}" for (s, c), g in proposal.guesses.items())
        missing = [one for one in REQUIRED if one not in {c for _, c in proposal.guesses}]
        lacking = f" It has no ankle {' and no ankle '.join(missing)}." if missing else ""
        raise GaitInputError(
            f"No leg is whole: a vertical force, an ankle moment and an ankle angle are needed, "
            f"seen was {seen}.{lacking} Let the lab send what is missing, or give the file that "
            "has it in the same command. In a C3D, plates with their place and markers at "
            "malleolus, knee and toes are enough."
        )
    frame = None if proposal.frame is None else SignalColumn(proposal.frame)
    time = SignalColumn(proposal.time, proposal.time_factor)
    return add_own(ColumnMap(time, whole, frame), columns)


def add_own(found: ColumnMap, columns: Collection[str]) -> ColumnMap:
    """Return a map with what plates and markers came to beside its channels, where it has none."""
    own = SIGNAL_LAYOUTS["garry"].legs
    legs = {
        side: {
            **{
                channel: SignalColumn(name)
                for channel in CHANNELS
                if (name := OWN + own[side][channel].name) in columns
            },
            **leg,
        }
        for side, leg in found.legs.items()
    }
    return replace(found, legs=legs)


def _measure(time_s: Floats, legs: dict[str, LegSamples], proposal: Proposal) -> list[Stride]:
    return measure_strides(
        time_s,
        legs,
        rate_hz=proposal.rate_hz,
        mass_kg=proposal.mass_kg,
        is_overground=proposal.is_overground,
    )


def _find_timing(
    channel: str, time_s: Floats, leg: LegSamples, strides: list[Stride]
) -> float | None:
    """Return when the ankle brakes, or by how much later than its force the moment falls [s]."""
    if channel == "angle":
        return find_deceleration_peak(time_s, leg.angle_rad, strides)
    force, moment = np.asarray(leg.force_n), np.asarray(leg.moment_nm)
    lags = []
    for stride in strides:
        length = stride.terminal_contact_s - stride.initial_contact_s
        begin_s = stride.terminal_contact_s - 0.28 * length
        part = slice(*np.searchsorted(time_s, (begin_s, stride.terminal_contact_s)))
        if part.stop - part.start < 6:
            continue
        rate_hz = (part.stop - part.start - 1) / float(time_s[part.stop - 1] - time_s[part.start])
        lag_s = find_moment_lag(force[part] - stride.offset_n, moment[part], rate_hz)
        if lag_s is not None and math.isfinite(lag_s):
            lags.append(lag_s)
    return median(lags) if len(lags) >= STRIDES_MIN else None


def _describe_own(proposal: Proposal) -> list[str]:
    if not any(guess.column.startswith(OWN) for guess in proposal.guesses.values()):
        return []
    return [
        "Moment and angle are computed from plates and markers. Of three people A2 was 8 % off "
        "their own systems' at most by joint centers, and 6 to 22 % lower by malleoli: compare it "
        "with itself alone."
    ]


def _describe_missing(proposal: Proposal) -> list[str]:
    sides = {side for side, _ in proposal.guesses}
    return [
        f"No {side} {channel} was recognized."
        for side in sorted(sides)
        for channel in REQUIRED
        if (side, channel) not in proposal.guesses
    ]


def _describe_timing(timing: dict[tuple[str, str], float | None], usual_s: float) -> list[str]:
    """Return what is unusual about the moments' times; of the angles the self-check tells it."""
    unknown = [f"{side} {channel}" for (side, channel), at_s in timing.items() if at_s is None]
    found = [f"Too few strides to tell whether in time: {', '.join(unknown)}."] if unknown else []
    for (side, channel), at_s in timing.items():
        if channel == "moment" and at_s is not None and abs(at_s) > usual_s:
            order = "later" if at_s > 0 else "earlier"
            cutoff_hz = math.sqrt(2) / (2 * math.pi * abs(at_s))
            by_filter = (
                f" Your system may filter moment and angle as they come, with about {cutoff_hz:.0f}"
                " Hz: let it not, or filter forward and backward. If it must, give its cut-off "
                f"(--filtered {cutoff_hz:.0f}); A2 is then -4 to +2 % off at 6 Hz."
                if at_s > 0 and FILTERED_HZ[0] <= cutoff_hz
                else ""
            )
            found.append(
                f"The {side} moment falls {abs(at_s) * 1000:.0f} ms {order} than its force; up to "
                f"{usual_s * 1000:.0f} ms are usual. Look at how the two are "
                f"synchronized: A2 changes by about 1.4 % a millisecond.{by_filter}"
            )
    return found
