"""Units that labs send in, and the sizes by which they are told apart."""

from __future__ import annotations

import math

from rehab.gait.one_leg import GRAVITY_M_S2

TIME_UNITS = {"s": 1.0, "ms": 1e-3, "µs": 1e-6}
# What one of each is in N, Nm and rad; of units by body mass, for 1 kg.
FORCE_UNITS = {"N": 1.0, "kN": 1e3, "kgf": GRAVITY_M_S2, "lbf": 4.44822, "mN": 1e-3}
FORCE_BY_MASS = {"N/kg": 1.0, "body weights": GRAVITY_M_S2}
MOMENT_UNITS = {"Nm": 1.0, "Nmm": 1e-3, "kNm": 1e3, "lbf·ft": 1.35582, "lbf·in": 0.112985}
MOMENT_BY_MASS = {"Nm/kg": 1.0, "Nmm/kg": 1e-3}
ANGLE_UNITS = {"rad": 1.0, "°": math.pi / 180, "mrad": 1e-3}
# The force passes 0.10 to 0.16 m before the ankle where the moment peaks (moore2013: 0.12, 0.13).
LEVER_M, LEVER_SPREAD = 0.13, 0.25
ANGLE_RAD, ANGLE_SPREAD = 0.5, 0.6  # range over a stride; 0.3 in an orthosis
MASS_USUAL_KG = (35.0, 160.0)
