"""A checked set-up, told: as lines to read, as data for a page, as arguments to measure with."""

from __future__ import annotations

from typing import Any

from rehab.gait.recordings.column_mapping import SignalColumn
from rehab.gait.setup.check import SetupCheck
from rehab.gait.setup.guess import Guess


def describe_setup(check: SetupCheck, command: str = "") -> list[str]:
    """Return a set-up check as lines to read, the last of them the command that measures with it.

    Parameters
    ----------
    check
        What was found.
    command
        The command's beginning, to which the arguments are added; empty where a person has it.
    """
    proposal = check.proposal
    sources = {"plates": "measured with the plates", "file": "by the file", "given": "as given"}
    lines = [
        f"time   {proposal.time} × {proposal.time_factor:g}, {proposal.rate_hz:.1f} Hz; "
        f"{check.late} samples late, {check.lost} times lost",
        f"mass   {proposal.mass_kg:.1f} kg, {sources[proposal.mass_source]}",
    ]
    for (side, channel), guess in sorted(proposal.guesses.items()):
        lines.append(f"{side:5}  {_describe_guess(guess, check.timing_s.get((side, channel)))}")
    a2 = "".join(f", A2 {side} {value:.2f} W/kg" for side, value in check.a2_w_kg.items())
    lines.append(f"{check.strides} strides, {check.valid} valid{a2}")
    lines += [f"! {text}" for text in check.findings]
    measure = f"{command} {format_arguments(check)}".strip()
    return [*lines, "", "If that is right, measure with:", "  " + measure]


def _describe_guess(guess: Guess, at_s: float | None) -> str:
    sign = "turned, " if guess.factor < 0 else ""
    after = "after its foot has left" if guess.channel == "angle" else "after its force"
    timing = "" if at_s is None else f", {1000 * at_s:+.0f} ms {after}"
    sure = "sure" if guess.is_certain else "look at it"
    return f"{guess.channel:7} {guess.column} in {guess.unit} ({sign}{sure}{timing})"


def format_arguments(check: SetupCheck) -> str:
    """Return the command line's arguments that measure with this set-up."""
    pairs = [f"time={_format_column(check.columns.time)}"]
    pairs += [] if check.columns.frame is None else [f"frame={check.columns.frame.name}"]
    pairs += [
        f"{side}.{channel}={_format_column(column)}"
        for side, leg in check.columns.legs.items()
        for channel, column in leg.items()
    ]
    quoted = " ".join(f"'{pair}'" if set(pair) & set(" *()'$&;|") else pair for pair in pairs)
    over = "--overground " if check.proposal.is_overground else ""
    return f"--mass {check.proposal.mass_kg:.1f} {over}--columns {quoted}"


def _format_column(column: SignalColumn) -> str:
    factor = "" if column.factor == 1 else f"*{column.factor:.9g}"
    return f"{column.name}{factor}"


def setup_to_json(check: SetupCheck, columns: list[str]) -> dict[str, Any]:
    """Return a set-up check as plain data.

    Parameters
    ----------
    check
        What was found.
    columns
        Names of all columns that there are.
    """
    proposal = check.proposal
    return {
        "columns": columns,
        "time": {"column": proposal.time, "factor": proposal.time_factor},
        "rate_hz": proposal.rate_hz,
        "mass_kg": round(proposal.mass_kg, 1),
        "is_mass_measured": proposal.mass_source == "plates",
        "is_overground": proposal.is_overground,
        "a2_w_kg": check.a2_w_kg,
        "late": check.late,
        "lost": check.lost,
        "strides": check.strides,
        "valid": check.valid,
        "findings": list(check.findings),
        "channels": [
            {
                "side": side,
                "channel": channel,
                "column": guess.column,
                "factor": guess.factor,
                "unit": guess.unit,
                "is_certain": guess.is_certain,
                "doubt": guess.doubt,
                "timing_s": check.timing_s.get((side, channel)),
            }
            for (side, channel), guess in sorted(proposal.guesses.items())
        ],
        "arguments": format_arguments(check),
    }
