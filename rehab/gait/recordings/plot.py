"""A plot of each leg's force, contacts and A2. Needs matplotlib, which GARRY does not install."""

from __future__ import annotations

import importlib
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from rehab.gait.signals.filters import Floats
from rehab.gait.strides import GaitInputError, Stride


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
    path: Path, t_s: Floats, forces_n: Mapping[str, Floats], strides: Sequence[Stride]
) -> None:
    """Draw force with contacts, and A2 of each stride, to an image file, two rows a leg.

    Parameters
    ----------
    path
        The file to write; its suffix determines the format.
    t_s
        Times [s], shape (n,).
    forces_n
        Vertical force by side [N], shape (n,) each.
    strides
        Of all sides.

    Raises
    ------
    GaitInputError
        Where matplotlib is not installed.
    """
    pyplot = load_pyplot()
    figure, rows = pyplot.subplots(
        2 * len(forces_n), 1, figsize=(12, 5 * len(forces_n)), sharex=True, squeeze=False
    )
    for number, (side, force) in enumerate(forces_n.items()):
        own = [stride for stride in strides if stride.side == side]
        top, bottom = rows[2 * number][0], rows[2 * number + 1][0]
        top.plot(t_s, force, color="0.5", linewidth=0.8)
        for stride in own:
            color = "tab:green" if stride.valid else "tab:red"
            top.axvspan(stride.initial_contact_s, stride.terminal_contact_s, color=color, alpha=0.2)
        top.set_ylabel(f"{side}: force [N]")
        for valid, color in ((True, "tab:green"), (False, "tab:red")):
            shown = [s for s in own if s.valid is valid and s.a2_w_kg is not None]
            bottom.plot(
                [s.terminal_contact_s for s in shown],
                np.clip([s.a2_w_kg or 0.0 for s in shown], -2, 15),
                "o",
                color=color,
                label="valid" if valid else "invalid",
            )
        bottom.set_ylabel(f"{side}: A2 [W/kg]")
        bottom.legend(loc="upper right")
    rows[-1][0].set_xlabel("time [s]")
    figure.tight_layout()
    figure.savefig(path)
    pyplot.close(figure)
