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
# Mean vertical force of a stance by body weight: half of a stride by its stance. Of the five
# people of the corpus 0.77 to 0.84 (medians of a leg): enough to tell units apart, not a mass.
STANCE_LOAD, FORCE_SPREAD = 0.8, 0.15
# The force passes 0.13 to 0.17 m in front of the ankle where the moment peaks (the same five).
LEVER_M, LEVER_SPREAD = 0.13, 0.25
ANGLE_RAD, ANGLE_SPREAD = (
    0.5,
    0.6,
)  # range over a stride: 0.40 to 0.64 (the same); 0.3 in an orthosis
MASS_USUAL_KG = (35.0, 160.0)
