"""Files as other labs write them, made of a walk whose strides are known."""

from __future__ import annotations

import io
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from statistics import median

import numpy as np

from rehab.gait import LegSamples, measure_strides
from rehab.gait.recordings.csv_files import apply_columns
from rehab.gait.recordings.readers import read_any_table
from rehab.gait.setup.check import SetupCheck, check_setup
from tests.gait.corpus import DEGREES, SIDES, CorpusWalk, find_clean
from tests.gait.walks import make_walk

TO_DEGREES = 1 / DEGREES
NEAR_S = 0.06


@dataclass(frozen=True)
class Names:
    """Columns of force, moment and angle of each leg; factors, ``per_kg`` one by body mass too."""

    left: tuple[str, str, str]
    right: tuple[str, str, str]
    factors: tuple[float, float, float] = (1.0, 1.0, TO_DEGREES)
    per_kg: bool = False

    def label(self, walk: CorpusWalk) -> dict[str, np.ndarray]:
        """Return a walk's columns by these names."""
        force, moment, angle = self.factors
        factors = (force, moment / walk.mass_kg if self.per_kg else moment, angle)
        return {
            name: np.asarray(row) * factor
            for side, names in (("left", self.left), ("right", self.right))
            for name, row, factor in zip(names, walk.legs[side][:3], factors, strict=True)
        }


def both(form: str, *parts: str, sides=("L", "R"), **given) -> Names:
    """Return names of a form such as ``{side}_{part}``."""
    left, right = (tuple(form.format(side=s, part=p) for p in parts) for s in sides)
    return Names(left, right, **given)  # type: ignore[arg-type]


NAMES = {
    "Plug-in Gait, a subject's": Names(
        ("Force.Fz1", "P 01:LAnkleMoment_X", "P 01:LAnkleAngles_X"),
        ("Force.Fz2", "P 01:RAnkleMoment_X", "P 01:RAnkleAngles_X"),
        (-1, 1000, -TO_DEGREES), per_kg=True,
    ),
    "CGM2": Names(
        ("Fz1", "LAnkleMoment_cgm2.X", "LAnkleAngles_cgm2.X"),
        ("Fz2", "RAnkleMoment_cgm2.X", "RAnkleAngles_cgm2.X"),
        (-1, 1000, -TO_DEGREES), per_kg=True,
    ),
    "ISB, Y upward": Names(
        ("Fy1", "LAnkleMomentZ", "LAnkleAngleZ"), ("Fy2", "RAnkleMomentZ", "RAnkleAngleZ"),
        (1, -1, -TO_DEGREES), per_kg=True,
    ),
    "HBM": Names(
        ("FP1.ForY", "LAnkleFlexion.Mom", "LAnkleFlexion.Ang"),
        ("FP2.ForY", "RAnkleFlexion.Mom", "RAnkleFlexion.Ang"),
    ),
    "plates in the other order": Names(
        ("FP2_Fz", "L_Ankle_Moment", "L_Ankle_Angle"), ("FP1_Fz", "R_Ankle_Moment", "R_Ankle_Angle")
    ),
    "a script's": both("{part}_{side}", "vGRF", "M_ankle", "theta_ankle", sides=("left", "right")),
    "a script's, in rad": both("{part}_{side}", "Fz", "tau_ankle", "q_ankle",
                               sides=("l", "r"), factors=(1, -1, -1)),
    "Noraxon": both("{side} {part}", "Force Z (N)", "Ankle Moment (Nm)",
                    "Ankle Dorsiflexion (deg)", sides=("LT", "RT"), factors=(1, 1, -TO_DEGREES)),
    "German": both("{part} {side}", "Vertikalkraft", "Sprunggelenksmoment", "Sprunggelenkswinkel",
                   sides=("links", "rechts")),
    "Dutch": both("{part} {side}", "Kracht", "Enkelmoment", "Enkelhoek", sides=("links", "rechts")),
    "Italian": both("{part} {side}", "Forza verticale", "Momento caviglia", "Angolo caviglia",
                    sides=("sinistra", "destra")),
    "Portuguese": both("{part} {side}", "Força", "Momento tornozelo", "Ângulo tornozelo",
                       sides=("esquerdo", "direito")),
    "mirrored signs": both("{side}_{part}", "Fz", "AnkMom", "AnkAng", factors=(-1, -1, -1)),
}  # fmt: skip


def make_known_walk(**given) -> CorpusWalk:
    """Return a synthetic walk of both legs, whose left strides are known."""
    walk, truth = make_walk(strides=20, jitter_s=0.0, **given)
    legs = {side: LegSamples(*getattr(walk, side)) for side in SIDES}
    known = tuple(("left", s.initial_contact_s, s.terminal_contact_s) for s in truth)
    return CorpusWalk("synthetic", walk.t_s, legs, walk.mass_kg, False, known=known)


def from_zero(walk: CorpusWalk, rate_hz: float | None = None) -> CorpusWalk:
    """Return a walk whose times begin at zero, if wanted on an even grid."""
    start_s = walk.t_s[0]
    known = walk.known or tuple((c.side, c.begin_s, c.end_s) for c in find_clean(walk))
    moved = tuple((side, begin_s - start_s, end_s - start_s) for side, begin_s, end_s in known)
    t_s = walk.t_s - start_s
    even_s = t_s if rate_hz is None else np.arange(0, t_s[-1], 1 / rate_hz)
    legs = {
        side: LegSamples(*(np.interp(even_s, t_s, np.asarray(row, float)) for row in leg[:3]))
        for side, leg in walk.legs.items()
    }
    return replace(walk, t_s=even_s, legs=legs, known=moved, power_w_kg={}, events_s={})


def write_table(path: Path, heads: list[list[str]], rows: list[np.ndarray], *, comma: str = ",",
                point: str = ".", above: str = "") -> Path:  # fmt: skip
    """Write lines of heads, then numbers."""
    text = io.StringIO()
    np.savetxt(text, np.column_stack(rows), "%.7g", comma)
    lines = "".join(comma.join(head) + "\n" for head in heads)
    path.write_text(above + lines + text.getvalue().replace(".", point), encoding="utf-8")
    return path


def write_named(folder: Path, walk: CorpusWalk, names: Names, **given) -> list[Path]:
    columns = {"Time": walk.t_s} | names.label(walk)
    return [write_table(folder / "walk.csv", [list(columns)], list(columns.values()), **given)]


def spread(walk: CorpusWalk, factors=(1.0, 1.0, -TO_DEGREES), axes="ZXX") -> dict[str, np.ndarray]:
    """Return three axes of each channel, of which one means something."""
    chance = np.random.default_rng(0)
    found = {}
    for side in SIDES:
        parts = zip(("Force", "AnkleMoment", "AnkleAngles"), walk.legs[side][:3], factors, axes,
                    strict=True)  # fmt: skip
        for part, row, factor, upward in parts:
            values = np.asarray(row) * factor
            for axis in "XYZ":
                other = 0.2 * values * chance.normal(size=len(values))
                found[f"{side[0].upper()}{part}.{axis}"] = values if axis == upward else other
    return found


def write_two_heads(folder: Path, walk: CorpusWalk, *, units: bool = True, **given) -> list[Path]:
    """Names over their first axis alone, axes below them, and units."""
    columns = spread(walk)
    names = [name.split(".")[0] if name.endswith("X") else "" for name in columns]
    axes = [name[-1] for name in columns]
    kinds = {"F": "N", "M": "Nm", "A": "deg"}
    of = [kinds["F" if "Force" in n else "M" if "Moment" in n else "A"] for n in columns]
    heads = [["Time", *names], ["", *axes], *([["s", *of]] if units else [])]
    return [write_table(folder / "two.csv", heads, [walk.t_s, *columns.values()], **given)]


def write_visual3d(folder: Path, walk: CorpusWalk) -> list[Path]:
    columns = spread(walk, (1, -1 / walk.mass_kg, -TO_DEGREES))
    names = [name.split(".")[0] for name in columns]
    axes = [name[-1] for name in columns]
    count = len(names) + 1
    heads = [["", *["P01.c3d"] * count], ["", "TIME", *names], ["", *["LINK_MODEL_BASED"] * count],
             ["", *["ORIGINAL"] * count], ["ITEM", "X", *axes]]  # fmt: skip
    rows = [np.arange(len(walk.t_s)) + 1.0, walk.t_s, *columns.values()]
    return [write_table(folder / "v3d.txt", heads, rows, comma="\t")]


def write_qualisys(folder: Path, walk: CorpusWalk, *, point: str = ".") -> list[Path]:
    """Each plate a file, with the reaction's sign; moments and angles in a third one."""
    paths = []
    for number, side in enumerate(SIDES, 1):
        up = -np.asarray(walk.legs[side].force_n)
        names = ["SAMPLE", "TIME", "Force_X", "Force_Y", "Force_Z", "Moment_X", "COP_X"]
        rows = [np.arange(len(up)) + 1.0, walk.t_s, 0.05 * up, 0.02 * up, up, 0.3 * up, 0 * up]
        above = f"NO_OF_SAMPLES\t{len(up)}\nFREQUENCY\t{walk.rate_hz:.0f}\n"
        above += f"FORCE_PLATE_NAME\tForce-plate {number}\n"
        path = folder / f"walk_f_{number}.tsv"
        paths.append(write_table(path, [names], rows, comma="\t", point=point, above=above))
    ankles = both("{side} Ankle {part}_X", "", "Moment", "Angles", sides=("Left", "Right"),
                  factors=(1, 1, -TO_DEGREES), per_kg=True)  # fmt: skip
    columns = {n: v for n, v in ankles.label(walk).items() if "  " not in n and n.strip()}
    columns = {n: v for n, v in columns.items() if "Moment" in n or "Angles" in n}
    path = folder / "walk_model.txt"
    heads = [["Time", *columns]]
    rows = [walk.t_s, *columns.values()]
    return [*paths, write_table(path, heads, rows, comma="\t", point=point)]


def write_opensim(folder: Path, walk: CorpusWalk, force: str, angle: str, flag: str) -> list[Path]:
    """Forces, inverse dynamics and kinematics of the forms of names, angles in degrees or not."""
    factor = -TO_DEGREES if flag == "yes" else -1.0
    tables: dict[str, dict[str, np.ndarray]] = {"grf.mot": {}, "id.sto": {}, "ik.mot": {}}
    for side in SIDES[::-1]:
        letter = side[0]
        up, moment, turn = (np.asarray(row) for row in walk.legs[side][:3])
        for axis, share in zip("xyz", (0.1, 1.0, 0.03), strict=True):
            tables["grf.mot"][force.format(letter=letter, axis=axis)] = share * up
        tables["id.sto"] |= {f"knee_angle_{letter}_moment": 0.5 * moment,
                             f"ankle_angle_{letter}_moment": -moment}  # fmt: skip
        tables["ik.mot"] |= {f"knee_angle_{letter}": 0.4 * turn * factor,
                             angle.format(letter): turn * factor}  # fmt: skip
    paths = []
    for name, columns in tables.items():
        above = f"{name}\nversion=1\ninDegrees={flag if name == 'ik.mot' else 'no'}\nendheader\n"
        rows = [walk.t_s, *columns.values()]
        heads = [["time", *columns]]
        paths.append(write_table(folder / name, heads, rows, comma="\t", above=above))
    return paths


OPENSIM = "ankle_angle_{}"
FILES: Mapping[str, Callable[[Path, CorpusWalk], list[Path]]] = {
    **{name: partial(write_named, names=names) for name, names in NAMES.items()},
    "decimal commas": lambda f, w: write_named(f, w, NAMES["German"], comma=";", point=","),
    "two heads": lambda f, w: write_two_heads(f, w, units=False),
    "two heads, units": write_two_heads,
    "two heads, a title": lambda f, w: write_two_heads(f, w, above="P01\n"),
    "two heads, tabs, decimal commas": lambda f, w: write_two_heads(f, w, comma="\t", point=","),
    "Visual3D": write_visual3d,
    "Qualisys": write_qualisys,
    "Qualisys, decimal commas": lambda f, w: write_qualisys(f, w, point=","),
    **{f"OpenSim, {force}, {flag}": partial(write_opensim, force=force, angle=angle, flag=flag)
       for force, angle, flag in (
           ("ground_force_{letter}_v{axis}", OPENSIM, "yes"),
           ("ground_force_calcn_{letter}_v{axis}", OPENSIM, "no"),
           ("{letter}_ground_force_v{axis}", "/jointset/ankle_{0}/ankle_angle_{0}/value", "no"),
       )},
}  # fmt: skip


@dataclass(frozen=True)
class Verdict:
    """What one command made of a stranger's file: clean strides, those valid, A2's median error."""

    check: SetupCheck
    clean: int
    valid: int
    error: float


def judge(paths: list[Path], walk: CorpusWalk, mass_kg: float | None = None) -> Verdict:
    """Return what a file comes to, measured as the check proposes, against the walk itself."""
    table = read_any_table(*paths)
    check = check_setup(table, mass_kg)
    proposal = check.proposal
    t_s, legs = apply_columns(table, check.columns)
    strides = measure_strides(t_s, legs, rate_hz=proposal.rate_hz, mass_kg=proposal.mass_kg,
                              look_ahead_s=0.05, is_overground=proposal.is_overground)  # fmt: skip
    clean = find_clean(walk)
    errors = []
    for one in clean:
        near = [s for s in strides if s.valid and s.side == one.side
                and abs(s.terminal_contact_s - one.end_s) < NEAR_S]  # fmt: skip
        errors += [near[0].a2_w_kg / one.a2_w_kg - 1] if near and near[0].a2_w_kg else []
    return Verdict(check, len(clean), len(errors), median(errors) if errors else float("nan"))
