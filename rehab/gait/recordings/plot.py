"""A picture of strides: signals, A2, reasons and the mean gait cycle. Needs matplotlib."""

from __future__ import annotations

import importlib
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from rehab.gait.signals.filters import CUTOFF_HZ, Floats, ZeroPhaseFilter
from rehab.gait.signals.samples import LegSamples
from rehab.gait.strides import GaitInputError, Stride

# Okabe and Ito's colors, which color-blind people can distinguish; marks differ as well.
BLUE, ORANGE, GRAY = "#0072B2", "#D55E00", "#666666"
CYCLE = np.linspace(0, 1, 101)
ROWS = ("force [N/kg]", "moment [Nm/kg]", "angular velocity [rad/s]", "power [W/kg]")
A2_SHOWN = (-2.0, 15.0)  # W/kg


def load_pyplot() -> Any:
    """Return matplotlib.pyplot with a backend that draws to files only.

    Raises
    ------
    GaitInputError
        Where matplotlib is not installed.
    """
    try:
        importlib.import_module("matplotlib").use("Agg")
        return importlib.import_module("matplotlib.pyplot")
    except ImportError:
        raise GaitInputError(
            "A plot needs matplotlib, which is not installed. Cure: pip install matplotlib"
        ) from None


def plot_strides(
    path: Path,
    t_s: Floats,
    legs: Mapping[str, LegSamples],
    strides: Sequence[Stride],
    *,
    rate_hz: float,
    mass_kg: float,
) -> None:
    """Draw each leg's signals by time with A2 marked, and their mean and sd over the gait cycle.

    Invalid strides are hatched, and their reasons written on them.

    Parameters
    ----------
    path
        The file to write; its suffix determines the format.
    t_s, legs
        Times [s], shape (n,), and the channels by side.
    strides
        Of all sides.
    rate_hz, mass_kg
        Of the samples, and the body mass.

    Raises
    ------
    GaitInputError
        Where matplotlib is not installed.
    """
    pyplot = load_pyplot()
    count = len(ROWS) + 1
    figure, panels = pyplot.subplots(
        count * len(legs), 2, figsize=(16, 2.2 * count * len(legs)), squeeze=False,
        width_ratios=(4, 1),
    )  # fmt: skip
    for number, (side, leg) in enumerate(legs.items()):
        own = [stride for stride in strides if stride.side == side]
        block = panels[number * count : (number + 1) * count]
        curves = compute_curves(leg, rate_hz, mass_kg)
        for panel, label, values in zip(block, ROWS, curves, strict=False):
            panel[0].plot(t_s, values, color=GRAY, linewidth=0.8)
            panel[0].set_ylabel(f"{side}\n{label}")
            _mark_stances(panel[0], own)
            _plot_cycle(panel[1], t_s, values, own)
        _mark_a2(block[len(ROWS) - 1][0], own)
        _write_reasons(block[0][0], own)
        _plot_a2(block[-1][0], own, side)
        block[-1][1].axis("off")
        for panel in block[1:]:
            panel[0].sharex(block[0][0])
    panels[-1][0].set_xlabel("time [s]")
    panels[-2][1].set_xlabel("gait cycle, mean ± SD of valid strides [%]")
    figure.tight_layout()
    figure.savefig(path, dpi=80)
    pyplot.close(figure)


def compute_curves(leg: LegSamples, rate_hz: float, mass_kg: float) -> list[Floats]:
    """Return force [N/kg], moment [Nm/kg], angular velocity [rad/s] and power [W/kg], as drawn.

    Moment and angle are filtered over the whole recording, so the curves differ by about a percent
    from what a stride was measured with. Missing moments and angles are interpolated.

    Parameters
    ----------
    leg
        The leg's channels, shape (n,) each, as every curve that is returned.
    rate_hz, mass_kg
        Rate of the samples [Hz], and body mass [kg].
    """
    force, moment, angle = (np.asarray(channel, dtype=np.float64) for channel in leg[:3])
    known = np.arange(len(force))
    rows = np.array(
        [
            np.interp(known, known[np.isfinite(row)], row[np.isfinite(row)])
            if np.isfinite(row).any()
            else np.zeros(len(row))
            for row in (moment, angle)
        ]
    )
    smooth = ZeroPhaseFilter(CUTOFF_HZ, rate_hz).smooth(rows)
    velocity = np.gradient(smooth[1], 1 / rate_hz)
    return [force / mass_kg, smooth[0] / mass_kg, velocity, smooth[0] / mass_kg * velocity]


def _mark_stances(panel: Any, strides: Sequence[Stride]) -> None:
    for stride in strides:
        color, hatch = (BLUE, "") if stride.valid else (ORANGE, "///")
        panel.axvspan(
            stride.initial_contact_s, stride.terminal_contact_s, facecolor=color, alpha=0.15,
            hatch=hatch, edgecolor=color, linewidth=0,
        )  # fmt: skip


def _write_reasons(panel: Any, strides: Sequence[Stride]) -> None:
    top = panel.get_ylim()[1]
    for stride in strides:
        if stride.reasons:
            text = "\n".join(str(reason).replace("_", " ") for reason in stride.reasons)
            panel.text(
                stride.initial_contact_s, top, text, fontsize=6, color=ORANGE, rotation=90,
                va="top",
            )  # fmt: skip


def _mark_a2(panel: Any, strides: Sequence[Stride]) -> None:
    for valid, color, mark in ((True, BLUE, "o"), (False, ORANGE, "x")):
        shown = [s for s in strides if s.valid is valid and s.a2_w_kg is not None]
        panel.plot([s.a2_time_s for s in shown], _clip(shown), mark, color=color, markersize=4)


def _plot_a2(panel: Any, strides: Sequence[Stride], side: str) -> None:
    for valid, color, mark in ((True, BLUE, "o"), (False, ORANGE, "x")):
        shown = [s for s in strides if s.valid is valid and s.a2_w_kg is not None]
        panel.plot(
            [s.terminal_contact_s for s in shown], _clip(shown), mark, color=color,
            label="valid" if valid else "invalid",
        )  # fmt: skip
    panel.set_ylabel(f"{side}\nA2 [W/kg]")
    panel.legend(loc="upper right", fontsize=7)


def _plot_cycle(panel: Any, t_s: Floats, values: Floats, strides: Sequence[Stride]) -> None:
    """Draw mean and sd over the cycles that end with the contact of a valid stride."""
    cycles = [
        np.interp(
            s.initial_contact_s - s.stride_s * (1 - CYCLE), t_s[np.isfinite(values)],
            values[np.isfinite(values)],
        )
        for s in strides
        if s.valid and s.stride_s is not None
    ]  # fmt: skip
    if cycles:
        mean, sd = np.mean(cycles, axis=0), np.std(cycles, axis=0)
        panel.fill_between(100 * CYCLE, mean - sd, mean + sd, color=BLUE, alpha=0.25, linewidth=0)
        panel.plot(100 * CYCLE, mean, color=BLUE)


def _clip(strides: Sequence[Stride]) -> Floats:
    clipped: Floats = np.clip([s.a2_w_kg or 0.0 for s in strides], *A2_SHOWN)
    return clipped
