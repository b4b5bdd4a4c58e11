"""What the label of a column says that it is.

Labels of Plug-in Gait, CGM2, HBM, Visual3D, Theia, Qualisys and OpenSim differ in how they write
the same words: a side, a joint, a quantity, a plane. Labels are therefore split into words
(``LAnkleMoment.X``, ``L_ANKLE_MOMENT_X`` and ``Left Ankle Moment X`` alike) and compared with the
table below.
"""

from __future__ import annotations

import re
from dataclasses import dataclass

# Words of English, German, French, Spanish, Italian, Portuguese and Dutch labels.
SIDE = re.compile(
    r"\b(?:(left|lt|l|links|linke[rs]?|gauche|izq|izquierd[ao]|sinistr[ao]|sx|esquerd[ao])"
    r"|(right|rt|r|rechts|rechte[rs]?|droite?|derech[ao]|destr[ao]|dx|direit[ao]))"
    r"(?=\d?\b| ?ank)"
)
ANKLE = re.compile(
    r"\b[lr]?ank(le)?\b|\b[lr]?ankle|\b[lr]?ank(mom|ang)|sprunggelenk|knöchel|cheville|tobillo"
    r"|caviglia|tornozelo|enkel"
)
# Joints and quantities that are none of ours, wherever they stand in a label.
OTHER = [
    "knee",
    "hip",
    "pelvi",
    "trunk",
    "thora",
    "spine",
    "neck",
    "head",
    "shoulder",
    "elbow",
    "wrist",
    "waist",
    "lumbar",
    "subtalar",
    "mtp",
    "toe",
    "abs",
    "progress",
    "power",
    "pow",
    "vel",
    "speed",
    "acc",
    "inver",
    "ever",
    "rotation",
    "adduction",
    "abduction",
    "arm",
    "pressure",
    "emg",
    "limit",
    *("knie", "hüft", "becken", "rumpf", "schulter", "ellenbogen", "handgelenk"),
    *("genou", "hanche", "bassin", "tronc", "épaule", "coude", "poignet"),
    *("rodilla", "cadera", "hombro", "codo", "cuello", "muñeca"),
    *("ginocchio", "anca", "bacino", "joelho", "quadril", "heup", "bekken"),
]
MOMENT = re.compile(r"mom(ent)?s?\b|moment|torque|\btrq|\btau\b|\bm ank")
ANGLE = re.compile(
    r"winkel|hoek|[aáâ]ng[uo]lo|\bang(le)?s?\b|[a-z]angles?v?\b|[a-z]ang\b|flex|dorsi|plantar"
    r"|\brot\b|\btheta\b|\bq ank"
)
# Of a plate's axes, the one upward is found by its size (``find_forces``).
FORCE = re.compile(
    r"\bplates (left|right)\b|\bverti[ck]al|\bvert\b|\bforce n\b|\b[lr]?f ?\d* ?[yz] ?\d*\b"
    r"|\b(forces?|for|grfs?|fp ?\d*|plate ?\d*) ?\d*( [lr]| left| right)? ?v? ?[yz] ?\d*\b"
    r"|\bv[yz]\b|\bv ?grfs?\b|\bgrfs? v\b|\b(kraft|kracht|fuerza|forza|força)\b"
    r"|\b(force|grf) (l|r|left|right)\b|\b(l|r|left|right) (force|grf)$"
)
NO_FORCE = re.compile(r"mom|torque|\bcop|pos|normali|\bp[xyz]\b|ank|sprungg|cheville|tobillo")
OTHERS = {  # what a column without a label is not, by other words in its name
    "force": (ANKLE, MOMENT, ANGLE),
    "moment": (FORCE, ANGLE, re.compile(r"force|grf|kraft|kracht|fuerza|forza")),
    "angle": (FORCE, MOMENT, re.compile(r"force|grf|kraft|kracht|fuerza|forza")),
}
AXIS = re.compile(r"[XYZ](Inf|Sup)?$")
PLANE = re.compile(r"\b([xyz])\b(?: theia)?$")
# Which direction a label counts as positive, by the program that writes it.
SIGNS = (
    ("angle", re.compile(r"^(?!.*dorsi).*plantar"), 1),
    ("angle", re.compile(r"^(?!.*plantar).*dorsi"), -1),
    ("angle", re.compile(r"^ankle angle [lr]\b"), -1),  # OpenSim
    ("angle", re.compile(r"^[lr] ankle angles\b"), -1),  # Plug-in Gait, CGM2
    ("moment", re.compile(r"^(?!.*dorsi).*plantar"), 1),
    ("moment", re.compile(r"^ankle angle [lr] moment"), -1),  # OpenSim
)
UNITS = {
    "n": "N", "newton": "N", "newtons": "N", "kn": "kN", "mn": "mN", "kgf": "kgf", "lbf": "lbf",
    "n/kg": "N/kg", "bw": "body weights", "%bw": "% body weight", "nm": "Nm", "nmm": "Nmm",
    "knm": "kNm",
    "nm/kg": "Nm/kg", "nmm/kg": "Nmm/kg", "lbfft": "lbf·ft", "lbfin": "lbf·in", "rad": "rad",
    "radians": "rad", "mrad": "mrad", "deg": "°", "degree": "°", "degrees": "°", "°": "°",
}  # fmt: skip


@dataclass(frozen=True, slots=True)
class Label:
    """What a label says: a channel, the leg (or empty), its axis (or empty), its sign (or 0)."""

    channel: str
    side: str
    axis: str
    sign: int

    @property
    def is_sagittal(self) -> bool:
        """Whether the axis is that of flexion in most programs; by ISB's rules it is z."""
        return self.axis in {"", "x"}


def read_label(column: str) -> Label | None:
    """Return what a column's label says, None where it names none of our channels."""
    words, side = split_label(column), find_side(column)
    if any(other in words for other in OTHER):
        return None
    if FORCE.search(words) and not NO_FORCE.search(words):
        return Label("force", side, "", 0)
    is_own = bool(re.search(r"\b(left|right) (moment nm|angle rad)$", words))
    if not side or not (ANKLE.search(words) or is_own):
        return None
    channel = "moment" if MOMENT.search(words) else "angle" if ANGLE.search(words) else ""
    if not channel:
        return None
    plane = PLANE.search(words)
    signs = [sign for what, form, sign in SIGNS if what == channel and form.search(words)]
    return Label(channel, side, plane[1] if plane else "", signs[0] if signs else 0)


def find_side(column: str) -> str:
    """Return the leg that a label names, or empty, whatever else it says."""
    sides = {"left" if left else "right" for left, _ in SIDE.findall(split_label(column))}
    return sides.pop() if len(sides) == 1 else ""


def names_another(column: str, channel: str) -> bool:
    """Return whether a label names something else than a channel, or a marker's axis."""
    words = split_label(column)
    return (
        any(other in words for other in OTHER)
        or any(form.search(words) for form in OTHERS[channel])
        or bool(re.search(r"\bground|\bcop\b|\bm[xyz]\d?\b|\bpos", words))
    )


def read_unit(column: str, units: dict[str, str]) -> str:
    """Return a column's unit by its file, or by its label (``Fz [N]``, ``ankle_deg``), or empty."""
    written = units.get(column, "")
    if not written:
        ending = re.search(r"[\[(]([^\])]+)[\])]\s*$|_(nm|n|rad|deg|degrees)$", column.lower())
        written = (ending[1] or ending[2]) if ending else ""
    return UNITS.get(re.sub(r"[\s.·*_^-]|newton-?(?=m)", "", written.lower()), "")


def split_label(column: str) -> str:
    """Return a label's words in lower case, without its unit."""
    subject, _, name = column.rpartition(":")
    if AXIS.match(name):  # of iSen, behind the label: a value, or the limits of usual ones
        name = subject if name == "Y" else f"{subject} limit"
    bare = re.sub(r"\s*[\[(][^\])]*[\])]\s*$", "", name)
    spaced = re.sub(r"(?<=[a-z])(?=[A-Z])|(?<=[A-Z])(?=[A-Z][a-z])", " ", bare)
    return re.sub(r"[\W_]+", " ", spaced).strip().lower()
