"""``python -m rehab.gait FILE …``: the strides of recorded signals.

Files are CSV with a header and one row a sample. Known layouts are found by their header; others
are mapped with ``--columns``. With ``--json``, one line is printed for each file: an object with
its strides and its self-check.
"""

from __future__ import annotations

import argparse
import json
import math
import sys
from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path

import numpy as np

from rehab.gait.offline import measure_both_legs, measure_strides
from rehab.gait.recordings.columns import CHANNELS
from rehab.gait.recordings.csv_files import estimate_rate, read_mass, read_signals
from rehab.gait.recordings.plot import load_pyplot, plot_strides
from rehab.gait.selfcheck.checks import check_signals
from rehab.gait.strides import GaitInputError, Stride

LOOK_AHEAD_S = 0.05


def main(arguments: Sequence[str] | None = None) -> int:
    """Measure each file and print its strides.

    Parameters
    ----------
    arguments
        The command line without the program's name; None for that of the process.

    Returns
    -------
    The exit status: 0, or 2 after input that cannot be measured.
    """
    options = _read_options(arguments)
    try:
        if options.plot:
            load_pyplot()
            if len(options.files) > 1:
                raise GaitInputError("One plot shows one recording. Give one file with --plot.")
        for path in options.files:
            _measure_file(path, options)
    except (GaitInputError, OSError) as error:
        print(error, file=sys.stderr)
        return 2
    return 0


def _read_options(arguments: Sequence[str] | None) -> argparse.Namespace:
    parser = argparse.ArgumentParser(
        prog="python -m rehab.gait", description="Strides and A2 of recorded signals."
    )
    parser.add_argument("files", nargs="+", type=Path, metavar="FILE")
    parser.add_argument("--json", action="store_true", help="one JSON object a file")
    parser.add_argument("--mass", type=float, help="body mass [kg]; moore2013 has it beside it")
    parser.add_argument("--rate", type=float, help="samples per second; else the median of times")
    parser.add_argument("--look-ahead", type=float, default=LOOK_AHEAD_S, metavar="S")
    parser.add_argument(
        "--columns",
        nargs="+",
        metavar="CHANNEL=COLUMN",
        help="time=… and {left,right}.{" + ",".join(CHANNELS) + "}=…; COLUMN*FACTOR changes "
        "unit or sign",
    )
    parser.add_argument("--plot", type=Path, metavar="out.png", help="draw it (needs matplotlib)")
    return parser.parse_args(arguments)


def _measure_file(path: Path, options: argparse.Namespace) -> None:
    time, legs = read_signals(path, options.columns)
    rate_hz = estimate_rate(time, path) if options.rate is None else options.rate
    mass_kg = read_mass(path) if options.mass is None else options.mass
    if len(legs) == 2:
        strides = measure_both_legs(
            time,
            legs["left"],
            legs["right"],
            rate_hz=rate_hz,
            mass_kg=mass_kg,
            look_ahead_s=options.look_ahead,
        )
    else:
        ((side, leg),) = legs.items()
        strides = measure_strides(
            time,
            *leg,
            rate_hz=rate_hz,
            mass_kg=mass_kg,
            look_ahead_s=options.look_ahead,
            side=side,
        )
    check = check_signals(
        time, legs.get("left"), legs.get("right"), rate_hz=rate_hz, mass_kg=mass_kg
    )
    if options.json:
        found = {
            "file": str(path),
            "rate_hz": rate_hz,
            "mass_kg": mass_kg,
            "look_ahead_s": options.look_ahead,
            "strides": [asdict(stride) for stride in strides],
            "check": asdict(check),
        }
        print(json.dumps(found, allow_nan=False))
    else:
        _print_summary(path, strides, [finding.message for finding in check.findings])
    if options.plot:
        forces = {side: np.asarray(leg.force_n) for side, leg in legs.items()}
        plot_strides(options.plot, time, forces, strides)


def _print_summary(path: Path, strides: list[Stride], messages: list[str]) -> None:
    print(path)
    print(f"{'side':>5} {'contact':>9} {'leaves':>9} {'A2 W/kg':>8} {'stride s':>8}  why invalid")
    for stride in strides:
        a2 = math.nan if stride.a2_w_kg is None else stride.a2_w_kg
        stride_s = math.nan if stride.stride_s is None else stride.stride_s
        print(
            f"{stride.side:>5} {stride.initial_contact_s:9.3f} {stride.terminal_contact_s:9.3f} "
            f"{a2:8.3f} {stride_s:8.3f}  {' '.join(stride.reasons)}"
        )
    valid = [s.a2_w_kg for s in strides if s.valid and s.a2_w_kg is not None]
    mean = f", mean A2 {np.mean(valid):.3f} W/kg" if valid else ""
    print(f"{len(strides)} strides, {len(valid)} valid{mean}")
    for message in messages:
        print(f"! {message}")


if __name__ == "__main__":
    sys.exit(main())
