"""``python -m rehab.gait FILE …``: the strides of recorded signals; ``check FILE``: its set-up.

Files are CSV with a header and one row a sample. Known layouts are found by their header; others
are mapped with ``--columns``. With ``--json``, one line is printed for each file: an object with
its strides and its self-check.
"""

from __future__ import annotations

import argparse
import json
import math
import shlex
import sys
from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path

import numpy as np

from rehab.gait.offline import measure_strides
from rehab.gait.recordings.column_mapping import ALL_CHANNELS, read_column, read_column_map
from rehab.gait.recordings.csv_files import apply_columns, read_mass, save_signals
from rehab.gait.recordings.plot import load_pyplot, plot_strides
from rehab.gait.recordings.readers import read_any_table, read_signals, require_columns
from rehab.gait.recordings.resource_limits import limit_resources
from rehab.gait.selfcheck.checks import check_signals
from rehab.gait.settings import check_mass
from rehab.gait.setup.check import add_own, check_setup, compare_with_setup
from rehab.gait.setup.report import describe_setup, setup_to_json
from rehab.gait.signals.clock import estimate_rate
from rehab.gait.signals.frame_clock import find_frame_problem
from rehab.gait.strides import GaitInputError, Stride
from rehab.gait.wearables import Place
from rehab.gait.wearables.detector import WearableDetector

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
    words = list(sys.argv[1:] if arguments is None else arguments)
    if words[:1] == ["check"]:
        return check_files(words[1:])
    if words[:1] == ["wearable"]:
        return measure_wearables(words[1:])
    options = _read_options(words)
    try:
        if options.plot:
            load_pyplot()
            if len(options.files) > 1 and not options.join:
                raise GaitInputError("One plot shows one recording. Give one file with --plot.")
        walks = [options.files] if options.join else [[path] for path in options.files]
        for paths in walks:
            _measure_walk(paths, options)
    except (GaitInputError, OSError) as error:
        print(error, file=sys.stderr)
        return 2
    return 0


def _read_options(arguments: Sequence[str]) -> argparse.Namespace:
    parser = argparse.ArgumentParser(
        prog="python -m rehab.gait",
        description="Strides and A2 of recorded signals; 'check FILE' finds out what its columns "
        "are.",
    )
    parser.add_argument("files", nargs="+", type=Path, metavar="FILE")
    parser.add_argument(
        "--join", action="store_true", help="the files are of one walk: join them by their times"
    )
    parser.add_argument("--json", action="store_true", help="one JSON object a file")
    parser.add_argument("--mass", type=float, help="body mass [kg]; moore2013 has it beside it")
    parser.add_argument("--rate", type=float, help="samples per second; else the median of times")
    parser.add_argument("--look-ahead", type=float, default=LOOK_AHEAD_S, metavar="S")
    parser.add_argument(
        "--overground", action="store_true", help="over plates in a floor, a step or two at a time"
    )
    parser.add_argument(
        "--filtered",
        type=float,
        metavar="HZ",
        help="moment and angle come through a causal low-pass of this cut-off: take its delay out",
    )
    parser.add_argument(
        "--columns",
        nargs="+",
        metavar="CHANNEL=COLUMN",
        help="time=… and {left,right}.{" + ",".join(ALL_CHANNELS) + "}=…; COLUMN*FACTOR changes "
        "unit or sign, COLUMN@DELAY takes out a delay [s]; frame=… counts samples",
    )
    parser.add_argument("--plot", type=Path, metavar="out.png", help="draw it (needs matplotlib)")
    return parser.parse_args(arguments)


def _measure_walk(paths: Sequence[Path], options: argparse.Namespace) -> None:
    path = paths[0]
    time, legs, frames, says_so = read_signals(
        *paths, pairs=options.columns, filtered_hz=options.filtered
    )
    is_overground = options.overground or says_so
    rate_hz = estimate_rate(time) if options.rate is None else options.rate
    mass_kg = read_mass(path) if options.mass is None else options.mass
    strides = measure_strides(
        time,
        legs,
        rate_hz=rate_hz,
        mass_kg=mass_kg,
        look_ahead_s=options.look_ahead,
        is_overground=is_overground,
        frame=frames,
    )
    check = check_signals(
        time,
        legs.get("left"),
        legs.get("right"),
        rate_hz=rate_hz,
        mass_kg=mass_kg,
        strides=strides,
        is_overground=is_overground,
    )
    if options.json:
        found = {
            "file": str(path),
            "rate_hz": rate_hz,
            "mass_kg": mass_kg,
            "look_ahead_s": options.look_ahead,
            "strides": [stride._asdict() for stride in strides],
            "check": asdict(check),
        }
        print(json.dumps(found, allow_nan=False))
    else:
        problem = find_frame_problem(time, frames)
        _print_summary(path, strides, [problem, *(finding.message for finding in check.findings)])
    if options.plot:
        plot_strides(options.plot, time, legs, strides, rate_hz=rate_hz, mass_kg=mass_kg)


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
    for message in filter(None, messages):
        print(f"! {message}")


def check_files(arguments: Sequence[str]) -> int:
    """Print what the columns of a walk's files are thought to be, for a person to confirm.

    Returns
    -------
    The exit status: 0 where all is sure, 1 where a person has to look at something, 2 where nothing
    is recognized or what was given is wrong.
    """
    parser = argparse.ArgumentParser(
        prog="python -m rehab.gait check",
        description="What columns, units, signs, legs, mass and delays are, from walking.",
    )
    parser.add_argument("files", nargs="+", type=Path, metavar="FILE",
                        help="of one walk; several are joined by their times")  # fmt: skip
    parser.add_argument("--mass", type=float,
                        help="body mass [kg]; else by the file, or the plates")  # fmt: skip
    parser.add_argument(
        "--columns",
        nargs="+",
        metavar="CHANNEL=COLUMN",
        help="what you take them for: wrong ones are refused with what was seen",
    )
    parser.add_argument("--overground", action=argparse.BooleanOptionalAction,
                        help="over plates in a floor, or not; else by the steps")  # fmt: skip
    parser.add_argument("--json", action="store_true", help="as one JSON object")
    parser.add_argument("--save", type=Path, metavar="NEW.csv",
                        help="write the signals in SI units, if nothing is wrong")  # fmt: skip
    parser.add_argument("--bounded", action="store_true",
                        help="for files of strangers: a minute of processor, 4 GiB")  # fmt: skip
    options = parser.parse_args(arguments)
    if options.bounded:
        limit_resources()
    try:
        return _check_walk(options)
    except (GaitInputError, OSError) as error:
        print(f"{', '.join(path.name for path in options.files)}: {error}", file=sys.stderr)
        return 2


def _check_walk(options: argparse.Namespace) -> int:
    """Print what the columns of a walk are; return the exit status."""
    if options.mass is not None:
        check_mass(options.mass)
    table = read_any_table(*options.files)
    if not options.json:
        print(f"Comparing {len(table)} columns …", file=sys.stderr)
    given = read_column_map(options.columns) if options.columns else None
    check = check_setup(table, options.mass, is_overground=options.overground)
    if options.json:
        print(json.dumps(setup_to_json(check, list(table)), allow_nan=False))
    else:
        words = ["python", "-m", "rehab.gait", *["--join"][: len(options.files) - 1]]
        command = shlex.join([*words, *map(str, options.files)])
        print(*options.files, *describe_setup(check, command), sep="\n")
    wrong = compare_with_setup(check, given) if given else []
    for text in wrong:
        print(text, file=sys.stderr)
    if options.save and not wrong:
        columns = add_own(given, table) if given else check.columns
        require_columns(options.files[0], table, columns)
        frame = columns.frame or check.columns.frame
        frames = None if frame is None else table[frame.name]
        is_overground = check.proposal.is_overground
        signals = apply_columns(table, columns)
        save_signals(options.save, *signals, frames, is_overground=is_overground)
    return 2 if wrong else 0 if check.is_certain else 1


def measure_wearables(arguments: Sequence[str]) -> int:
    """Print the strides of a sensor on foot or shank; return the exit status."""
    parser = argparse.ArgumentParser(
        prog="python -m rehab.gait wearable",
        description="Contacts, times and angles by a sensor on a leg, mounted in any way.",
    )
    parser.add_argument("file", type=Path, metavar="FILE")
    parser.add_argument("--time", default="time", help="column of times [s] (default: time)")
    parser.add_argument("--columns", required=True, metavar="COLUMN[*FACTOR][,…]",
                        help="three accelerations [m/s²] and three rates [rad/s], or only the rate "
                        "from left to right; *0.01745 for degrees")  # fmt: skip
    parser.add_argument("--place", choices=[str(one) for one in Place], default="foot")
    options = parser.parse_args(arguments)
    try:
        columns = [read_column(one) for one in options.columns.split(",")]
        table = read_any_table(options.file)
        missing = [one for one in (options.time, *(c.name for c in columns)) if one not in table]
        if missing or len(columns) not in (1, 6):
            raise GaitInputError(
                f"{options.file.name} has no column {', '.join(missing)}. It has: "
                f"{', '.join(table)}."
                if missing
                else "Give one column or six: ax,ay,az,gx,gy,gz."
            )
        rows = np.stack([table[one.name] * one.factor for one in columns], axis=1)
        detector = WearableDetector(options.place)
        rates, accelerations = (
            (rows[:, 0], None) if len(columns) == 1 else (rows[:, 3:], rows[:, :3])
        )
        strides = detector.feed(table[options.time], rates, accelerations)
        if detector.left is None:
            raise GaitInputError(
                "No strides are found. Give rates in rad/s (COLUMN*0.01745 for degrees) and "
                "accelerations in m/s² (COLUMN*9.81 for g), of at least five strides."
            )
    except (GaitInputError, OSError) as error:
        print(error, file=sys.stderr)
        return 2
    print(
        f"{'contact':>9} {'leaves':>9} {'stride s':>9} {'stance %':>9} {'strike °':>9}  why invalid"
    )
    for one in strides:
        strike = math.nan if one.foot_strike_rad is None else math.degrees(one.foot_strike_rad)
        print(
            f"{one.initial_contact_s:9.3f} {one.terminal_contact_s:9.3f} {one.stride_s:9.3f} "
            f"{100 * one.stance_share:9.1f} {strike:9.1f}  {' '.join(one.reasons)}"
        )
    axis = ", ".join(f"{part:z.2f}" for part in detector.left)
    print(f"{len(strides)} strides; the walker's left is ({axis})")
    return 0


if __name__ == "__main__":
    sys.exit(main())
