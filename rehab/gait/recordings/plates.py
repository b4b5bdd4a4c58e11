"""Which leg stands on which force plate, by where its ankle is."""

from __future__ import annotations

import numpy as np

from rehab.gait.signals.filters import Floats

LOADED_N = 30.0
STEP_N = 150.0  # a contact that never bears so much is noise
BESIDE_MM, BEFORE_MM = 20.0, 150.0  # the ankle of a foot on a plate lies so far outside at most
LOWER_MM = 20.0  # an ankle that swings by is higher by this in mid-stance, or more
MIDDLE = (0.2, 0.6)  # of a contact
OWN = 0.8  # of a plate's contacts: then all that it reads is that leg's


def assign_plates(
    loads: Floats, corners_mm: Floats, ankles_mm: dict[str, Floats]
) -> tuple[dict[str, Floats], int]:
    """Return each leg's loads, shape (rows, n), and how many contacts are of neither leg.

    A contact belongs to the leg whose ankle is over the plate, and lower if both are. A plate on
    which only one leg steps is that leg's whole, with what it reads in swing.

    Parameters
    ----------
    loads
        What each plate bears, shape (plates, rows, n): its vertical force, upward positive [N], and
        whatever else of it adds up.
    corners_mm
        The plates' corners in the plane of the floor [mm], shape (plates, 4, 2).
    ankles_mm
        A marker of each ankle by side [mm], shape (3, n) each, the third axis upward.
    """
    borne = {side: np.zeros(loads.shape[1:]) for side in ankles_mm}
    unknown = 0
    for plate, plate_mm in zip(loads, corners_mm, strict=True):
        plate_n = plate[0]
        loaded = np.concatenate(([False], plate_n > LOADED_N, [False]))
        edges = np.flatnonzero(loaded[1:] != loaded[:-1]).reshape(-1, 2).tolist()
        steps = [(a, b) for a, b in edges if plate_n[a:b].max() > STEP_N]
        owners = [_find_owner(a, b, plate_mm, ankles_mm) for a, b in steps]
        unknown += owners.count(None)
        most = max(ankles_mm, key=owners.count)
        if owners.count(most) > 0 and owners.count(most) >= OWN * len(owners):
            borne[most] += plate
            continue
        for (first, stop), owner in zip(steps, owners, strict=True):
            if owner is not None:
                borne[owner][:, first:stop] += plate[:, first:stop]
    return borne, unknown


def _find_owner(
    first: int, stop: int, plate_mm: Floats, ankles_mm: dict[str, Floats]
) -> str | None:
    """Return the leg that makes a contact, None where neither or both may."""
    length = stop - first
    part = slice(first + int(MIDDLE[0] * length), first + int(MIDDLE[1] * length) + 1)
    size = np.ptp(plate_mm, axis=0)
    reach = np.where(size == size.max(), BEFORE_MM, BESIDE_MM)
    low, high = plate_mm.min(axis=0) - reach, plate_mm.max(axis=0) + reach
    heights = {}
    for side, marker in ankles_mm.items():
        at = marker[:, part][:, np.isfinite(marker[:, part]).all(axis=0)]
        if at.shape[1]:
            middle = np.median(at[:2], axis=1)
            if (low <= middle).all() and (middle <= high).all():
                heights[side] = float(np.median(at[2]))
    ranked = sorted(heights, key=lambda side: heights[side])
    if len(ranked) == 2 and heights[ranked[1]] - heights[ranked[0]] < LOWER_MM:
        return None
    return ranked[0] if ranked else None
