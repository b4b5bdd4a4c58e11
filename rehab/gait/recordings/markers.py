"""Markers of the legs by their labels, however a lab writes them.

``LANK``, ``L.Ankle``, ``LeftAnkleLat``, ``l_ankle_lateral`` and ``ANK_L`` are one place.
"""

from __future__ import annotations

import re
from collections.abc import Collection
from itertools import chain

SIDES = {"l": "left", "left": "left", "r": "right", "right": "right"}
OUTER = re.compile(r"lateral|lat|outer|out|ext")
INNER = re.compile(r"medial|med|inner|int")
# Of each place the words that stand for it without side, lateral or medial, the best first.
ANKLES = ("ank", "ankle", "ankl", "mal", "mall", "malleolus", "malleoli", "lm", "lmal", "lank",
          "lmall", "fal")  # fmt: skip
HEELS = ("hee", "heel", "fcc", "cal", "calc", "calcaneus")
KNEES = ("kne", "knee", "lek", "le", "lfe", "fle", "lkne", "lepi", "epi", "epicondyle", "condyle")
FIFTHS = ("mt5", "fm5", "5mt", "met5", "meta5", "5meta", "mtp5", "5mtp", "vmh", "toe5")
TOES = ("mt2", "fm2", "2mt", "mtp2", "2mtp", "toe2", "met2", "meta2", "2meta", "smh", "toe",
        "toes", *FIFTHS)  # fmt: skip
INNER_ANKLES = ("mm", "mmal", "tam", "ankm", "mank", "mmall")
INNER_KNEES = ("mek", "me", "mfe", "fme", "knm", "knem", "mkne", "mepi")
TROCHANTERS = ("gtr", "gtro", "tro", "troc", "trochanter", "greatertrochanter", "ftc")
# Centers of joints as the file's own program computed them: Plug-in Gait's bones, and by name.
CENTERS = {
    "ankle": ("tio", "ajc", "anklejc", "anklejointcenter", "anklejointcentre"),
    "knee": ("feo", "kjc", "kneejc", "kneejointcenter", "kneejointcentre"),
    "hip": ("fep", "hjc", "hipjc", "hipjointcenter", "hipjointcentre"),
}
# What is taken by place, and what beside it: the joint or the forefoot is in the middle.
PLACES = {
    "ankle": (ANKLES + HEELS, INNER_ANKLES),
    "knee": (KNEES, INNER_KNEES),
    "toe": (TOES, FIFTHS),
    "hip": (TROCHANTERS, ()),
}
KNOWN = {
    name
    for names in (*CENTERS.values(), *map(chain.from_iterable, PLACES.values()))
    for name in names
}


def find_markers(labels: Collection[str]) -> dict[tuple[str, str], str]:
    """Return labels by side and by what ``PLACES`` and ``CENTERS`` call their place.

    Parameters
    ----------
    labels
        As in the file; a subject's name before a colon is passed over.
    """
    found: dict[tuple[str, str], str] = {}
    for label in labels:
        side, rest = _split_side(label.rpartition(":")[2])
        if side:
            found.setdefault((side, _name_place(rest)), label)
    return found


def _split_side(label: str) -> tuple[str, str]:
    """Return the side that a label names, or empty, and its other words as one."""
    spaced = re.sub(r"(?<=[a-z])(?=[A-Z])", " ", label)
    words = [word for word in re.split(r"[\W_]+", spaced.lower()) if word]
    sides = [SIDES[word] for word in words if word in SIDES]
    if len(sides) == 1:
        return sides[0], "".join(word for word in words if word not in SIDES)
    whole = "".join(words)
    return ("", "") if sides or len(whole) < 3 else (SIDES.get(whole[0], ""), whole[1:])


def _name_place(rest: str) -> str:
    """Return a place in the words of the table: ``anklemed`` is ``mm``."""
    for joint in () if rest in KNOWN else ("ankle", "knee"):
        outer, inner = PLACES[joint]
        if INNER.search(rest) and INNER.sub("", rest, count=1) in outer:
            return inner[0]
        if OUTER.search(rest) and OUTER.sub("", rest, count=1) in outer:
            return joint
    return "mm" if rest == "med" else rest  # CGM2's medial malleolus
