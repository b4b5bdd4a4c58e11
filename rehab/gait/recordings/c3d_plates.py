"""Force plates and leg markers of a C3D file: each leg's force, and its ankle computed from them.

Positions are taken along two horizontal axes and upward, whichever axis of the file that is: the
one that its plates face.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from rehab.gait.recordings.c3d_parameters import read_labels, read_values
from rehab.gait.recordings.column_mapping import CHANNELS, MEDIAL, SIDES, SIGNAL_LAYOUTS
from rehab.gait.recordings.inverse_dynamics import add_computed
from rehab.gait.recordings.markers import ANKLES, CENTERS, PLACES, find_markers
from rehab.gait.recordings.plates import assign_plates
from rehab.gait.recordings.table import Table
from rehab.gait.signals.filters import Floats

# By the C3D manual's type of a plate: three forces, where they press and a moment; forces and
# moments; eight forces of four corners (Kistler); forces and moments after a calibration.
PRESSED, MEASURED, CORNERED, CALIBRATED = 1, 2, 3, 4
CHANNELS_OF = {PRESSED: 6, MEASURED: 6, CORNERED: 8, CALIBRATED: 6}


def add_plates(file: Any, table: Table) -> None:
    """Add each leg's vertical force [N], and its ankle's moment [Nm] and angle [rad].

    They are ``plates.left``, and ``own.left_moment_nm`` and ``own.left_angle_rad`` where there are
    markers at malleolus, knee and toes; with these forward force
    and foot, and where there are hips, these and the knee's angle. Nothing is added where the file
    does not say where its plates are, or has no markers at the ankles.
    """
    corners = np.asarray(read_values(file, "FORCE_PLATFORM", "CORNERS"), dtype=np.float64)
    channels = np.asarray(read_values(file, "FORCE_PLATFORM", "CHANNEL"), dtype=np.int64)
    types = np.asarray(read_values(file, "FORCE_PLATFORM", "TYPE"), dtype=np.int64).ravel()
    labels = read_labels(file, "ANALOG")
    if corners.ndim != 3 or channels.ndim != 2 or not np.isin(types, tuple(CHANNELS_OF)).all():
        return
    if not ((channels >= 0) & (channels <= len(labels))).all() or not len(types):
        return
    if corners.shape[:2] != (3, 4) or not corners.shape[2] == channels.shape[1] == len(types):
        return
    counts = [CHANNELS_OF[kind] for kind in types.tolist()]
    if channels.shape[0] < max(counts):
        return
    if any((channels[:count, n] <= 0).any() for n, count in enumerate(counts)):
        return
    unit = read_values(file, "POINT", "UNITS")
    to_m = {"m": 1.0, "cm": 0.01}.get(str(unit[0]).strip(), 0.001) if len(unit) else 0.001
    corners_m = to_m * corners.transpose(2, 1, 0)
    up = _find_up(corners_m)
    axes = [(up + 1) % 3, (up + 2) % 3, up]
    floor_m = float(corners_m[:, :, up].mean())
    markers, centers = _read_markers(file, table, to_m, axes)
    ankles = {side: markers[side, "ankle"] for side in SIDES if (side, "ankle") in markers}
    if len(ankles) < 2:
        return
    plates = enumerate(corners_m)
    loads = np.array([_read_plate(file, table, n, at_m, to_m, axes) for n, at_m in plates])
    borne, unknown = assign_plates(
        loads,
        1000 * corners_m[:, :, axes[:2]],
        {side: 1000 * marker for side, marker in ankles.items()},
    )
    ahead = _find_direction(markers)
    for side, load in borne.items():
        if not load[0].any():
            continue
        table[f"plates.{side}"] = load[0]
        table.units[f"plates.{side}"] = (
            "N" if CALIBRATED in types else table.units.get(labels[channels[2, 0] - 1], "")
        )
        if ahead is not None and (side, "knee") in markers and (side, "toe") in markers:
            leg = _make_leg(load, markers, centers, side, ahead, floor_m)
            for channel, column in SIGNAL_LAYOUTS["garry"].legs[side].items():
                if channel in leg and channel in CHANNELS[1:]:
                    table[f"own.{column.name}"] = leg[channel]
    if unknown:
        table.notes = (
            f"{unknown} contacts of a plate are of both feet or of neither, and left out",
        )


def _find_up(corners_m: Floats) -> int:
    """Return the axis that plates face, from their corners, shape (plates, 4, 3)."""
    facing = np.cross(corners_m[:, 0] - corners_m[:, 1], corners_m[:, 0] - corners_m[:, 3])
    return int(np.abs(facing).sum(axis=0).argmax())


def _read_markers(
    file: Any, table: Table, to_m: float, axes: list[int]
) -> tuple[dict[tuple[str, str], Floats], dict[tuple[str, str], Floats]]:
    """Return markers, and what is in the middle of a joint or the forefoot, by side and place [m].

    Shape (3, n) each: two horizontal axes, and upward. An ankle is a malleolus, or a heel, which
    does not tell an angle and has no other name.
    """
    names = find_markers(read_labels(file, "POINT"))

    def read(side: str, places: Sequence[str]) -> Floats | None:
        for name in (names.get((side, place)) for place in places):
            if name is not None and f"{name}.Z" in table:
                return to_m * np.array([table[f"{name}.{'XYZ'[axis]}"] for axis in axes])
        return None

    markers, centers = {}, {}
    for side in SIDES:
        has_malleolus = read(side, ANKLES) is not None
        for place, (outer, inner) in PLACES.items():
            marker, beside = read(side, outer), read(side, inner)
            center = read(side, CENTERS.get(place, ()))
            if center is None and marker is not None and beside is not None:
                center = (marker + beside) / 2
            if marker is not None and (has_malleolus or place == "ankle"):
                markers[side, place] = marker
            if center is not None and has_malleolus and np.isfinite(center).any():
                centers[side, place] = center
    return markers, centers


def _read_plate(
    file: Any, table: Table, plate: int, corners_m: Floats, to_m: float, axes: list[int]
) -> Floats:
    """Return a plate's loads: force upward and along both horizontal axes [N], its moments about
    these [Nm] at the origin on the floor. Shape (5, n).
    """
    kind = int(np.ravel(read_values(file, "FORCE_PLATFORM", "TYPE"))[plate])
    channels = np.asarray(read_values(file, "FORCE_PLATFORM", "CHANNEL"), dtype=np.int64)[:, plate]
    labels = read_labels(file, "ANALOG")
    rows = np.array([table[labels[place - 1]] for place in channels[: CHANNELS_OF[kind]]])
    calibration = np.asarray(read_values(file, "FORCE_PLATFORM", "CAL_MATRIX"), dtype=np.float64)
    if kind == CALIBRATED and calibration.ndim == 3:
        rows = calibration[:, :, plate] @ rows[: calibration.shape[1]]
    in_nm = kind == MEASURED and table.units.get(labels[channels[3] - 1], "").strip() in {
        "Nm", "N.m",
    }  # fmt: skip
    along = corners_m[0] - corners_m[1], corners_m[0] - corners_m[3]
    x, y = (edge / max(float(np.linalg.norm(edge)), 1e-9) for edge in along)
    turn = np.array([x, y, np.cross(x, y)])  # the plate's axes, in the file's
    origins = np.asarray(read_values(file, "FORCE_PLATFORM", "ORIGIN"), dtype=np.float64)
    is_known = origins.ndim == 2 and origins.shape[0] == 3 and origins.shape[1] > plate
    sensor_m = to_m * origins[:, plate] if is_known else np.zeros(3)
    if kind == PRESSED:
        rows[3:5] = rows[4] * rows[2], -rows[3] * rows[2]
        sensor_m = np.zeros(3)
    elif kind == CORNERED:
        beside, before = np.abs(sensor_m[:2]) / to_m  # from the middle to each sensor
        f1, f2, f3, f4 = rows[4:8]
        moments = before * (f1 + f2 - f3 - f4), beside * (f2 + f3 - f1 - f4)
        rows = np.array([rows[0] + rows[1], rows[2] + rows[3], f1 + f2 + f3 + f4, *moments, 0 * f1])
        sensor_m = np.array([0.0, 0.0, sensor_m[2]])
    # From the surface to the sensor, which lies below it, where the plate's third axis points.
    sensor_m = (sensor_m if sensor_m[2] >= 0 else -sensor_m) @ turn
    force = turn.T @ rows[:3]
    place_m = corners_m.mean(axis=0) + sensor_m
    place_m[axes[2]] = sensor_m[axes[2]]  # the floor is the origin's height
    moment = turn.T @ rows[3:6] * (1.0 if in_nm else to_m)
    moment += np.cross(place_m, force.T).T
    loads = np.array([*force[[axes[2], *axes[:2]]], *moment[axes[:2]]])
    return loads if loads[0].max() > -loads[0].min() else -loads  # some store the reaction


def _find_direction(markers: dict[tuple[str, str], Floats]) -> Floats | None:
    """Return where people walk, horizontally, shape (2,): where both feet point on average."""
    feet = [
        markers[side, "toe"][:2] - markers[side, "ankle"][:2]
        for side in SIDES
        if (side, "toe") in markers
    ]
    ahead = np.zeros(2)
    for foot in feet:
        length = np.linalg.norm(foot, axis=0)
        known = np.isfinite(length) & (length > 0)
        ahead += (foot[:, known] / length[known]).sum(axis=1) / max(1, np.count_nonzero(known))
    size = float(np.linalg.norm(ahead))
    return ahead / size if size > 1 else None  # of two: else they turn, or are no feet


def _make_leg(
    load: Floats,
    markers: dict[tuple[str, str], Floats],
    centers: dict[tuple[str, str], Floats],
    side: str,
    ahead: Floats,
    floor_m: float,
) -> dict[str, Floats]:
    """Return a leg's channels by its loads, its markers and what is in the middle of them."""
    up_n, places = load[0], markers | centers
    with np.errstate(divide="ignore", invalid="ignore"):
        cop_m = (ahead[1] * load[3] - ahead[0] * load[4]) / up_n
    leg = {"force": up_n, "forward": ahead @ load[1:3], "cop": cop_m}
    for place in (one for one in PLACES if (side, one) in places):
        at = places[side, place]
        leg |= {f"{place}_forward": ahead @ at[:2], f"{place}_up": at[2] - floor_m}
    if (side, "ankle") in centers:
        leg |= {MEDIAL[0]: leg["ankle_forward"], MEDIAL[1]: leg["ankle_up"]}
    add_computed(leg)
    return leg
