"""Which column of a recording is which channel."""

from __future__ import annotations

import math
from collections.abc import Collection, Sequence
from dataclasses import dataclass, field, replace

from rehab.gait.strides import GaitInputError

# A leg's channels as they are called on the command line, in the order of ``LegSamples``.
CHANNELS = (
    *("force", "moment", "angle", "forward", "position"),
    *("foot_up", "hip_forward", "hip_up", "knee_angle"),
)
REQUIRED = CHANNELS[:3]
# Instead of moment and angle: what they are computed from (``ankle``), in its order; and the other
# malleolus, without which the joint is guessed from the lateral one.
MARKED = (
    *("force", "forward", "cop"),
    *("ankle_forward", "ankle_up", "knee_forward", "knee_up", "toe_forward", "toe_up"),
)
MEDIAL = ("medial_forward", "medial_up")
ALL_CHANNELS = tuple(dict.fromkeys((*CHANNELS, *MARKED, *MEDIAL)))
SIDES = ("left", "right")
FILTERED_HZ = (4.0, 50.0)  # cut-offs of labs' filters that can be put back
# A column of a stored recording that is 1 where people walk over plates in a floor.
OVERGROUND = "overground"


def find_required(names: Collection[str]) -> tuple[str, ...]:
    """Return the channels that a leg needs to be measured, given which there are."""
    there = set(names)
    is_marked = there & set(MARKED[2:]) and not there >= set(REQUIRED)
    return MARKED if is_marked else REQUIRED


@dataclass(frozen=True, slots=True)
class SignalColumn:
    """A column by name, with what converts its numbers to SI units and our signs, and its delay.

    Attributes
    ----------
    name
        Of the column.
    factor
        What its numbers are multiplied with.
    delay_s
        By how much it comes later than the force [s].
    """

    name: str
    factor: float = 1.0
    delay_s: float = 0.0


@dataclass(frozen=True, slots=True)
class ColumnMap:
    """The time column [s], for each measured side the columns of its channels, the frame number."""

    time: SignalColumn
    legs: dict[str, dict[str, SignalColumn]] = field(default_factory=dict)
    frame: SignalColumn | None = None

    @property
    def columns(self) -> list[SignalColumn]:
        """All columns that a recording needs to have."""
        frame = [] if self.frame is None else [self.frame]
        legs = (column for leg in self.legs.values() for column in leg.values())
        return [self.time, *frame, *legs]

    def find_in(self, header: Sequence[str]) -> ColumnMap | None:
        """Return the part of this map that a header has: the time and whole legs, or None.

        A leg is whole without forward force and position; the frame number may be missing.
        """
        legs = {}
        for side, leg in self.legs.items():
            there = {channel: column for channel, column in leg.items() if column.name in header}
            if there.keys() >= set(find_required(there)):
                legs[side] = there
        frame = self.frame if self.frame is not None and self.frame.name in header else None
        return ColumnMap(self.time, legs, frame) if legs and self.time.name in header else None


def put_back_filtered(columns: ColumnMap, cutoff_hz: float) -> ColumnMap:
    """Return the map with moments and angles put back by what a causal low-pass delays them.

    Such a filter (Butterworth, second order) delays slow signals by √2 / (2π × cut-off). With that
    taken out, A2 is −4 to +2 % off at 6 Hz, −2 to +1 % at 8 Hz and less above (moore2013 and
    synthetic walkers of 0.8 to 5 W/kg; tests/gait/test_filtered.py).

    Raises
    ------
    GaitInputError
        For a cut-off [Hz] that no lab filters with.
    """
    low, high = FILTERED_HZ
    if not low <= cutoff_hz <= high:
        raise GaitInputError(
            f"Signals filtered with {cutoff_hz:g} Hz cannot be used. Give the cut-off of the lab's "
            f"low-pass, {low:g} to {high:g} Hz."
        )
    delay_s = math.sqrt(2) / (2 * math.pi * cutoff_hz)
    legs = {
        side: {
            channel: replace(column, delay_s=column.delay_s + delay_s)
            if channel in {"moment", "angle"}
            else column
            for channel, column in leg.items()
        }
        for side, leg in columns.legs.items()
    }
    return replace(columns, legs=legs)


def _moore_leg(side: str) -> dict[str, SignalColumn]:
    return {
        "force": SignalColumn(f"{side}GRF_y"),
        "moment": SignalColumn(f"{side}AnklePlantarFlexionMoment"),
        "angle": SignalColumn(f"{side}AnklePlantarFlexionAngle"),
        "forward": SignalColumn(f"{side}GRF_x"),
        "position": SignalColumn(f"{side}Foot_x"),
        "foot_up": SignalColumn(f"{side}Foot_y"),
        "knee_angle": SignalColumn(f"{side}KneeFlexionAngle"),
    }


def _own_leg(side: str) -> dict[str, SignalColumn]:
    units = {"force": "n", "moment": "nm", "angle": "rad", "forward": "n", "knee_angle": "rad"}
    return {
        channel: SignalColumn(f"{side}_{channel}_{units.get(channel, 'm')}")
        for channel in ALL_CHANNELS
    }


SIGNAL_LAYOUTS = {
    # As our sources send and store them.
    "garry": ColumnMap(
        SignalColumn("time_s"), {side: _own_leg(side) for side in SIDES}, SignalColumn("frame")
    ),
    # Moore, Hnat, van den Bogert 2015 (PeerJ 3:e918), as written by their GaitAnalysisToolKit.
    "moore2013": ColumnMap(
        SignalColumn("time"), {"left": _moore_leg("Left"), "right": _moore_leg("Right")}
    ),
}


def read_column_map(pairs: Sequence[str]) -> ColumnMap:
    """Return the map that command-line pairs such as ``left.angle=ANK_L*0.01745`` describe.

    Parameters
    ----------
    pairs
        ``time=COLUMN`` and ``SIDE.CHANNEL=COLUMN``; ``COLUMN*FACTOR`` changes unit or sign,
        ``COLUMN@DELAY`` takes out a delay [s]; both: ``COLUMN*FACTOR@DELAY``. ``frame=COLUMN`` is
        the device's own count of samples.

    Raises
    ------
    GaitInputError
        With the cure, for pairs of another form and for too few to measure a leg with.
    """
    time: SignalColumn | None = None
    frame: SignalColumn | None = None
    legs: dict[str, dict[str, SignalColumn]] = {}
    for pair in pairs:
        channel, _, text = pair.partition("=")
        side, _, what = channel.partition(".")
        if channel == "time" and text:
            time = read_column(text)
        elif channel == "frame" and text:
            frame = SignalColumn(text)
        elif side in SIDES and what in ALL_CHANNELS and text:
            legs.setdefault(side, {})[what] = read_column(text)
        else:
            raise GaitInputError(
                f"'{pair}' maps no column. Write time=COLUMN and SIDE.CHANNEL=COLUMN with SIDE "
                f"{' or '.join(SIDES)} and CHANNEL one of {', '.join(ALL_CHANNELS)}; "
                "frame=COLUMN if the device counts its samples."
            )
    if time is None or not legs:
        raise GaitInputError("Map the time and at least one leg: time=t left.force=Fz …")
    for side, leg in legs.items():
        missing = [channel for channel in find_required(leg) if channel not in leg]
        if missing:
            raise GaitInputError(
                f"The {side} leg has no {' and no '.join(missing)}. Map "
                + " ".join(f"{side}.{channel}=COLUMN" for channel in missing)
                + "."
            )
    return ColumnMap(time, legs, frame)


def find_layout(header: Sequence[str]) -> ColumnMap:
    """Return the known layout whose time and whole legs a header has.

    Raises
    ------
    GaitInputError
        Naming the known layouts, where none fits.
    """
    for layout in SIGNAL_LAYOUTS.values():
        columns = layout.find_in(header)
        if columns is not None:
            return columns
    raise GaitInputError(
        f"The columns fit no known layout ({', '.join(SIGNAL_LAYOUTS)}). Say which is which with "
        "--columns time=… left.force=… left.moment=… left.angle=…"
    )


def read_column(text: str) -> SignalColumn:
    """Return the column that a text such as ``ANK_L*0.01745@0.01`` describes."""
    text, delay_s = _split_number(text, "@", 0.0)
    return SignalColumn(*_split_number(text, "*", 1.0), delay_s)


def _split_number(text: str, mark: str, usual: float) -> tuple[str, float]:
    """Return a text without the number behind a mark, and the number; a name may have marks."""
    name, found, number = text.rpartition(mark)
    try:
        return (name, float(number)) if found and name else (text, usual)
    except ValueError:
        return text, usual
