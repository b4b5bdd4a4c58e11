"""Where a foot leaves and meets the floor that it drags over: by the slope of the force."""

from __future__ import annotations

import math

import numpy as np

from rehab.gait.signals.filters import Floats, find_upper_median

# A foot that leaves unloads by 1 N/ms and more below that; dragging, the force stays as it is.
DRAG_S = 0.08
ELBOW_S = 0.02
ELBOW_N = 8.0  # by which less is unloaded in ``ELBOW_S``
# A foot that is dragged once it has left bears less by so much when it leaves; how soon before, and
# over what the plate's noise is averaged.
DIP_N, DIP_S, QUIET_S = 12.0, 0.06, 0.005
LOADING_S = 0.06  # before the force of a contact is certain, a drag is over


def find_elbow(force_n: Floats, rate_hz: float, release_n: float) -> tuple[int, float] | None:
    """Return the sample at which a foot leaves that is dragged on, and the force there [N].

    Parameters
    ----------
    force_n
        From when it is too small for a contact, and ``ELBOW_S`` before, shape (n,).
    rate_hz, release_n
        Of the samples; and by how much the force exceeds the drag where the foot leaves.

    Returns
    -------
    None where the force falls on.
    """
    width = max(2, round(ELBOW_S * rate_hz))
    if not np.isfinite(force_n).all() or len(force_n) < 3 * width:
        return None
    mean = np.convolve(force_n, np.full(width, 1 / width), "valid")
    flat = np.flatnonzero(np.abs(mean[:-width] - mean[width:]) < ELBOW_N)
    if not len(flat):
        return None
    level = find_upper_median(force_n[flat[0] :]) + release_n
    above = np.flatnonzero(force_n > level)
    if not len(above):
        return int(flat[0]), level
    falls = min(int(above[-1]) + 1, len(force_n) - 1)
    dip = _find_dip(force_n[falls : falls + round(DIP_S * rate_hz)], rate_hz, level - release_n)
    return (falls, level) if dip is None else (falls + dip, float(force_n[falls + dip]))


def _find_dip(force_n: Floats, rate_hz: float, drag_n: float) -> int | None:
    """Return where a foot bears least before it is dragged, None where it bears no less."""
    least, least_n = find_least(force_n, rate_hz)
    return least if least_n < drag_n - DIP_N else None


def find_least(force_n: Floats, rate_hz: float) -> tuple[int, float]:
    """Return where a falling force is least before it rises again, and what it is there [N].

    The plate's noise is averaged.
    """
    width = max(1, round(QUIET_S * rate_hz))
    if len(force_n) < width:
        return 0, math.inf
    mean = np.convolve(force_n, np.full(width, 1 / width), "valid")
    risen = mean > np.minimum.accumulate(mean) + ELBOW_N
    again = int(risen.argmax())
    least = int(mean[: again if risen[again] else None].argmin())
    return least + width // 2, float(mean[least])


def find_drag(before_n: Floats, rate_hz: float, offset_n: float) -> float | None:
    """Return the force that drags a foot before it is loaded [N], None where nothing does.

    A foot that is loaded slowly is loaded more and more; one that is dragged rests on the way.

    Parameters
    ----------
    before_n
        Before the contact is certain, shape (n,).
    rate_hz, offset_n
        Of the samples, and the plate's zero [N].
    """
    loading, dragged = max(2, int(LOADING_S * rate_hz)), max(3, round(DRAG_S * rate_hz))
    held = before_n[-loading - dragged : -loading]
    if len(held) < dragged or not math.isfinite(held.sum()):
        return None
    half = len(held) // 2
    rise = find_upper_median(held[half:]) - find_upper_median(held[:half])
    drag = find_upper_median(held)
    return drag if drag > offset_n + ELBOW_N and abs(rise) < 2 * ELBOW_N else None
