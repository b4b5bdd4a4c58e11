"""Units that labs send in, and the sizes by which they are told apart."""

from __future__ import annotations

import math

from rehab.gait.one_leg import GRAVITY_M_S2

TIME_UNITS = {"s": 1.0, "ms": 1e-3, "µs": 1e-6}
# What one of each is in N, Nm and rad; of units by body mass, for 1 kg.
FORCE_UNITS = {
    "N": 1.0, "kN": 1e3, "kgf": GRAVITY_M_S2, "lbf": 4.44822, "mN": 1e-3, "N/kg": 1.0,
    "body weights": GRAVITY_M_S2,
}  # fmt: skip
MOMENT_UNITS = {
    "Nm": 1.0, "Nmm": 1e-3, "kNm": 1e3, "lbf·ft": 1.35582, "lbf·in": 0.112985, "Nm/kg": 1.0,
    "Nmm/kg": 1e-3,
}  # fmt: skip
BY_MASS = {"N/kg", "body weights", "Nm/kg", "Nmm/kg"}
ANGLE_UNITS = {"rad": 1.0, "°": math.pi / 180, "mrad": 1e-3}
# Mean vertical force of a stance by body weight: half of a stride by its stance. Of five people
# 0.76 to 0.86; it tells units apart, and nobody's mass.
STANCE_LOAD, FORCE_SPREAD = 0.8, 0.15
# The force passes 0.10 to 0.16 m before the ankle where the moment peaks (five people).
LEVER_M, LEVER_SPREAD = 0.13, 0.25
ANGLE_RAD, ANGLE_SPREAD = 0.5, 0.6  # range over a stride; 0.3 in an orthosis
MASS_USUAL_KG = (35.0, 160.0)
