"""Force plates and leg markers of a C3D file: each leg's force, and its ankle computed from them.

Positions are taken along two horizontal axes and upward, whichever axis of the file that is: the
one that its plates face.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from rehab.gait.recordings.ankle import add_computed
from rehab.gait.recordings.c3d_parameters import read_labels, read_values
from rehab.gait.recordings.columns import CHANNELS, MEDIAL, SIDES, SIGNAL_LAYOUTS
from rehab.gait.recordings.plates import assign_plates
from rehab.gait.recordings.table import Table
from rehab.gait.signals.filters import Floats

# By the C3D manual's type of a plate, the rows of its channels that are vertical; of the fourth
# after its calibration.
CALIBRATED = 4
VERTICAL = {1: slice(2, 3), 2: slice(2, 3), 3: slice(4, 8), CALIBRATED: slice(2, 3)}
WHOLE = (2, CALIBRATED)  # types whose channels are three forces, then three moments
# Markers by their labels after the letter of the side, the best first.
MALLEOLI = ("ANK", "LM", "ANKL", "LMAL", "LANK", "ANKLE", "LMALL", "MALL", "_ANK", "_LM", "_LMAL",
            "_ANKLE", "_FAL", "FAL")  # fmt: skip
HEELS = ("HEE", "_HEE", "HEEL", "_HEEL", "_FCC", "FCC", "_CAL", "CAL")
KNEES = ("KNE", "KNEE", "LEK", "LE", "LFE", "FLE", "LKNE", "LEPI", "_KNE", "_KNEE", "_LEK", "_FLE")
FIFTHS = ("MT5", "FM5", "5MT", "_MT5", "_FM5")
TOES = ("MT2", "FM2", "2MT", "MTP2", "TOE2", "_MT2", "_FM2", "TOE", "_TOE", *FIFTHS)
MEDIALS = ("MM", "MMAL", "MED", "MMED", "_MM", "_MMAL", "_TAM", "TAM", "ANKM", "_ANKM")
INNER_KNEES = ("MEK", "ME", "MFE", "_MEK", "_ME", "_FME", "FME", "KNM", "KNEM", "_KNEM", "MEPI")
TROCHANTERS = ("GTR", "GTRO", "TRO", "TROC", "FTC", "_GTR", "_FTC")
# Centers of joints as the file's own program computed them: Plug-in Gait's bones, and by name.
CENTERS = {
    "ankle": ("TIO", "AJC", "_AJC", "_ANKLE_JC"),
    "knee": ("FEO", "KJC", "_KJC", "_KNEE_JC"),
    "hip": ("FEP", "HJC", "_HJC", "_HIP_JC"),
}
# What is taken by place, and what beside it: the joint or the forefoot is in the middle.
PLACES = {
    "ankle": (MALLEOLI + HEELS, MEDIALS),
    "knee": (KNEES, INNER_KNEES),
    "toe": (TOES, FIFTHS),
    "hip": (TROCHANTERS, ()),
}


def add_plates(file: Any, table: Table) -> None:
    """Add each leg's vertical force [N], and its ankle's moment [Nm] and angle [rad].

    They are ``plates.left``, and ``own.left_moment_nm`` and ``own.left_angle_rad`` where there are
    markers at malleolus, knee and toes, and plates of the types 2 or 4; with these forward force
    and foot, and where there are hips, these and the knee's angle. Nothing is added where the file
    does not say where its plates are, or has no markers at the ankles.
    """
    corners = np.asarray(read_values(file, "FORCE_PLATFORM", "CORNERS"), dtype=np.float64)
    channels = np.asarray(read_values(file, "FORCE_PLATFORM", "CHANNEL"), dtype=np.int64)
    types = np.asarray(read_values(file, "FORCE_PLATFORM", "TYPE"), dtype=np.int64).ravel()
    labels = read_labels(file, "ANALOG")
    if corners.ndim != 3 or channels.ndim != 2 or not np.isin(types, tuple(VERTICAL)).all():
        return
    if not ((channels >= 0) & (channels <= len(labels))).all() or not len(types):
        return
    if corners.shape[:2] != (3, 4) or not corners.shape[2] == channels.shape[1] == len(types):
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
    is_whole = bool(np.isin(types, WHOLE).all()) and channels.shape[0] >= 6
    ahead = _find_direction(markers) if is_whole else None
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
    names = {name.rpartition(":")[2].upper(): name for name in read_labels(file, "POINT")}

    def read(letter: str, endings: Sequence[str]) -> Floats | None:
        for name in (names.get(letter + ending) for ending in endings):
            if name is not None and f"{name}.Z" in table:
                return to_m * np.array([table[f"{name}.{'XYZ'[axis]}"] for axis in axes])
        return None

    markers, centers = {}, {}
    for side, letter in (("left", "L"), ("right", "R")):
        has_malleolus = read(letter, MALLEOLI) is not None
        for place, (outer, inner) in PLACES.items():
            marker, beside = read(letter, outer), read(letter, inner)
            center = read(letter, CENTERS.get(place, ()))
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
    these [Nm] at the origin on the floor. Shape (5, n); a plate of other types has only the first.
    """
    kind = int(np.ravel(read_values(file, "FORCE_PLATFORM", "TYPE"))[plate])
    channels = np.asarray(read_values(file, "FORCE_PLATFORM", "CHANNEL"), dtype=np.int64)[:, plate]
    labels = read_labels(file, "ANALOG")
    rows = np.array([table[labels[place - 1]] for place in channels if place])
    calibration = np.asarray(read_values(file, "FORCE_PLATFORM", "CAL_MATRIX"), dtype=np.float64)
    if kind == CALIBRATED and calibration.ndim == 3:
        rows = calibration[:, :, plate] @ rows[: calibration.shape[1]]
    loads = np.zeros((5, rows.shape[1]))
    if kind not in WHOLE or len(rows) < 6:
        loads[0] = rows[VERTICAL[kind]].sum(axis=0)
    else:
        in_nm = kind == 2 and table.units.get(labels[channels[3] - 1], "").strip() in {"Nm", "N.m"}
        along = corners_m[0] - corners_m[1], corners_m[0] - corners_m[3]
        x, y = (edge / max(float(np.linalg.norm(edge)), 1e-9) for edge in along)
        turn = np.array([x, y, np.cross(x, y)])  # the plate's axes, in the file's
        origins = np.asarray(read_values(file, "FORCE_PLATFORM", "ORIGIN"), dtype=np.float64)
        is_known = origins.ndim == 2 and origins.shape[0] == 3 and origins.shape[1] > plate
        sensor_m = to_m * origins[:, plate] if is_known else np.zeros(3)
        # From the surface to the sensor, which lies below it, where the plate's third axis points.
        sensor_m = (sensor_m if sensor_m[2] >= 0 else -sensor_m) @ turn
        force = turn.T @ rows[:3]
        place_m = corners_m.mean(axis=0) + sensor_m
        place_m[axes[2]] = sensor_m[axes[2]]  # the floor is the origin's height
        moment = turn.T @ rows[3:6] * (1.0 if in_nm else to_m)
        moment += np.cross(place_m, force.T).T
        loads[:] = *force[[axes[2], *axes[:2]]], *moment[axes[:2]]
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
