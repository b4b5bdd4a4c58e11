"""A walk as a lab's C3D file, written by ezc3d."""

import numpy as np
import pytest


def write_c3d(path, walk):
    """Write force plates as analog channels, moment and angle as points at half their rate."""
    ezc3d = pytest.importorskip("ezc3d")
    file = ezc3d.c3d()
    count = len(walk.t_s) // 2
    points = np.ones((4, 4, count))
    for place, (leg, row, factor) in enumerate(
        [(leg, row, f) for leg in (walk.left, walk.right) for row, f in ((1, 1000), (2, 57.29578))]
    ):
        points[0, place] = leg[row][: 2 * count : 2] * factor
    file["parameters"]["POINT"]["RATE"]["value"] = [walk.rate_hz / 2]
    file["parameters"]["POINT"]["LABELS"]["value"] = [
        "LAnkleMoment", "LAnkleAngles", "RAnkleMoment", "RAnkleAngles"
    ]  # fmt: skip
    file["data"]["points"] = points
    file["parameters"]["ANALOG"]["RATE"]["value"] = [walk.rate_hz]
    file["parameters"]["ANALOG"]["LABELS"]["value"] = ["Fz1", "Fz2"]
    file["data"]["analogs"] = -np.array([[walk.left[0], walk.right[0]]])[:, :, : 2 * count]
    file.write(str(path))
