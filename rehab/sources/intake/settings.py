"""Settings of an intake that cannot be derived from the signals."""

from __future__ import annotations

from argparse import ArgumentParser, Namespace
from dataclasses import dataclass
from pathlib import Path
from typing import Self

from rehab.gait.recordings.column_mapping import (
    ALL_CHANNELS,
    SIDES,
    SIGNAL_LAYOUTS,
    ColumnMap,
    SignalColumn,
    put_back_filtered,
    read_column,
    read_column_map,
)
from rehab.gait.settings import LOOK_AHEAD_MAX_S, MASS_MAX_KG, MASS_MIN_KG
from rehab.sources.reporting import SourceError
from rehab.training.steps import Side

LOOK_AHEAD_S = 0.05  # reduces the error of A2 from 1.0 to 0.14 % (moore2013)


@dataclass(frozen=True, slots=True)
class Wearable:
    """A sensor on a walker: its leg, "foot" or "shank", and the columns of its samples.

    These are one rate of rotation about the axis from left to right, three rates, or three
    accelerations and three rates.
    """

    side: Side
    place: str
    columns: tuple[SignalColumn, ...]


@dataclass(frozen=True, slots=True)
class IntakeSettings:
    """How to read what comes.

    Attributes
    ----------
    mass_kg
        Body mass of the walker [kg]; raw signals cannot be used without it.
    rate_hz
        Samples per second; None to estimate it.
    look_ahead_s
        How long to wait after terminal contact for a better A2, 0-0.2 s.
    columns
        Which column is which channel, with factors for units and signs.
    side
        The leg of rows that name none; None for the session's trained one.
    keep
        Where the raw signals are written to, if anywhere.
    is_overground
        Whether people walk over plates in a floor, and not on a treadmill.
    wearables
        Instead of legs' signals: sensors on feet or shanks.
    """

    mass_kg: float | None = None
    rate_hz: float | None = None
    look_ahead_s: float = LOOK_AHEAD_S
    columns: ColumnMap = SIGNAL_LAYOUTS["garry"]
    side: Side | None = None
    keep: Path | None = None
    is_overground: bool = False
    wearables: tuple[Wearable, ...] = ()

    @classmethod
    def read(cls, options: Namespace) -> Self:
        """Return those of a command line. Raises SourceError or GaitInputError, with the cure."""
        mass_kg, look_ahead_s = options.mass, options.look_ahead
        if mass_kg is not None and not MASS_MIN_KG <= mass_kg <= MASS_MAX_KG:
            raise SourceError(
                f"A body mass of {mass_kg:g} kg cannot be used. Give --mass {MASS_MIN_KG:g} to "
                f"{MASS_MAX_KG:g}."
            )
        if not 0 <= look_ahead_s <= LOOK_AHEAD_MAX_S:
            raise SourceError(
                f"A look-ahead of {look_ahead_s:g} s cannot be used. Give --look-ahead 0 to "
                f"{LOOK_AHEAD_MAX_S:g}."
            )
        if options.keep is not None and options.keep.exists():
            raise SourceError(
                f"{options.keep} is there already, and recordings are never written over. "
                "Give --keep another name."
            )
        pairs, filtered_hz = (getattr(options, one, None) for one in ("columns", "filtered"))
        columns = read_column_map(pairs) if pairs else cls().columns
        if filtered_hz is not None:
            columns = put_back_filtered(columns, filtered_hz)
        return cls(
            mass_kg=mass_kg,
            rate_hz=options.rate,
            look_ahead_s=look_ahead_s,
            columns=columns,
            side=Side(options.side) if options.side else None,
            keep=options.keep,
            is_overground=getattr(options, "overground", False),
            wearables=tuple(
                _read_wearable(text) for text in getattr(options, "wearable", None) or ()
            ),
        )


def _read_wearable(text: str) -> Wearable:
    """Return what a text such as ``left.foot=gyro_z*0.01745`` says. Raises SourceError."""
    where, _, names = text.partition("=")
    place = read_place(where)
    columns = names.split(",")
    if place is None or not all(columns) or len(columns) not in (1, 3, 6):
        raise SourceError(
            f"'{text}' maps no worn sensor. Write SIDE.PLACE=COLUMNS with SIDE left or right, "
            "PLACE foot or shank, and one rate of rotation, three, or three accelerations and "
            "three rates: left.foot=gyro_z*0.01745, left.shank=ax,ay,az,gx,gy,gz"
        )
    return Wearable(*place, tuple(read_column(one) for one in columns))


def read_place(text: str) -> tuple[Side, str] | None:
    """Return the leg and place that a text such as ``left.foot`` names; None for any other."""
    side, _, place = text.partition(".")
    return (Side(side), place) if side in SIDES and place in ("foot", "shank") else None


def add_signal_arguments(parser: ArgumentParser) -> None:
    """Add the options for signals to a command line."""
    signals = parser.add_argument_group("raw signals")
    signals.add_argument("--mass", type=float, metavar="KG", help="the walker's body mass")
    signals.add_argument("--rate", type=float, metavar="HZ", help="default: by the samples' times")
    signals.add_argument(
        "--look-ahead",
        type=float,
        default=LOOK_AHEAD_S,
        metavar="S",
        help=f"wait after terminal contact for a better A2 (default {LOOK_AHEAD_S:g})",
    )
    signals.add_argument(
        "--columns",
        nargs="+",
        metavar="CHANNEL=COLUMN",
        help="time=… and {left,right}.{" + ",".join(ALL_CHANNELS) + "}=…; COLUMN*FACTOR changes "
        "unit or sign (default: time_s, left_force_n, left_moment_nm, left_angle_rad, right_…)",
    )
    signals.add_argument(
        "--filtered",
        type=float,
        metavar="HZ",
        help="moment and angle come through a causal low-pass of this cut-off: take its delay out",
    )
    signals.add_argument(
        "--overground", action="store_true", help="over plates in a floor, a step or two at a time"
    )
    signals.add_argument(
        "--wearable",
        nargs="+",
        metavar="SIDE.PLACE=COLUMNS",
        help="instead of forces: a sensor on a foot or shank, mounted in any way; accelerations in "
        "m/s² and rates in rad/s (left.foot=ax,ay,az,gx,gy,gz; gx*0.01745 for degrees), or only "
        "the rate about the axis from left to right (left.foot=gx)",
    )
    signals.add_argument(
        "--keep", type=Path, metavar="FILE", help="write the raw signals to a new file, here only"
    )
