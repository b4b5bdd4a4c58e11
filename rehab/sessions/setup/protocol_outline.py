"""A protocol at a glance: its phases as they will be walked, and how long they take."""

from __future__ import annotations

import math
from dataclasses import dataclass

from django.utils.translation import gettext

from rehab.sessions.formatting import NBSP, format_duration
from rehab.sessions.setup.protocol_models import Protocol
from rehab.training.phases import Phase

# Typical stride time of the recordings (docs/reference/gait.md#phases), for the duration of a phase
# that is limited by strides.
STRIDE_S = 1.1
OPEN_PHASE_S = 300  # a phase without an end is drawn as if it took this long, as in the admin
MOST_NAMED = 4  # of more phases, their number says more than their names
WIDTH, HEIGHT, LOW = 300.0, 20.0, 6.0  # of the drawing, and of a phase without feedback


@dataclass(frozen=True, slots=True)
class Block:
    """A phase as it is drawn: its place in a picture of 300 by 20.

    ``kind``: with or without feedback, and whether it is open, as the page's styles name it.
    """

    x: float
    y: float
    width: float
    height: float
    kind: str


@dataclass(frozen=True, slots=True)
class Outline:
    """What a protocol's choice shows: how long it takes, its phases in words, and a drawing."""

    length: str
    phases: str
    blocks: tuple[Block, ...]


def phase_length_s(phase: Phase) -> float | None:
    """Return a phase's duration [s]; None where it lasts until the PT moves on."""
    limits = [phase.seconds, phase.strides and phase.strides * STRIDE_S]
    return min((limit for limit in limits if limit), default=None)


def describe_phase_end(phase: Phase) -> str:
    """Return what ends a phase, in the active language."""
    if phase.strides is None:
        return _describe_length(phase)
    about_s = 5 * math.ceil((phase_length_s(phase) or 0) / 5)
    values = {"count": phase.strides, "time": format_duration(about_s)}
    return gettext("%(count)s strides, about %(time)s") % values


def protocol_minutes(protocol: Protocol | None) -> int | None:
    """Return a protocol's duration; None where a phase lasts until the PT moves on."""
    lengths = [phase_length_s(phase) for phase in (protocol.to_rules() if protocol else ())]
    known = [length for length in lengths if length is not None]
    return math.ceil(sum(known) / 60) or None if len(known) == len(lengths) else None


def describe_end(protocol: Protocol) -> str:
    """Return what ends a walk by a protocol, in the active language."""
    phases, minutes = protocol.to_rules(), protocol_minutes(protocol)
    if phases and phase_length_s(phases[-1]) is None:
        return gettext("You end the walk; the minutes are your plan.")
    if minutes is None:
        return gettext("You end some phases; the protocol ends the walk.")
    trained = sum(phase_length_s(one) or 0 for one in phases if one.kind == "training")
    if not trained:
        return gettext("The protocol ends the walk: %(all)s in all.") % {
            "all": format_duration(60 * minutes)
        }
    return gettext("The protocol ends the walk: %(trained)s of training, %(all)s in all.") % {
        "trained": format_duration(trained),
        "all": format_duration(60 * minutes),
    }


def outline_protocol(protocol: Protocol) -> Outline:
    """Return what a protocol's choice shows, in the active language."""
    phases = protocol.to_rules()
    minutes = protocol_minutes(protocol)
    return Outline(
        gettext("open end")
        if minutes is None
        else gettext("%(time)s in all") % {"time": format_duration(60 * minutes)},
        _describe_phases(phases),
        tuple(_draw_phases(phases)),
    )


def _describe_phases(phases: tuple[Phase, ...]) -> str:
    if len(phases) > MOST_NAMED:
        return gettext("%(count)s phases") % {"count": len(phases)}
    return " · ".join(f"{gettext(phase.name)} {_describe_length(phase)}" for phase in phases)


def _describe_length(phase: Phase) -> str:
    seconds = phase_length_s(phase)
    if seconds is None:
        return gettext("until you move on")
    return format_planned(seconds) if seconds == phase.seconds else format_duration(seconds)


def format_planned(seconds: float) -> str:
    """Return a time that was set, to the second: 45 s, 3 min, 2:30 min."""
    minutes, rest = divmod(round(seconds), 60)
    return f"{minutes}:{rest:02}{NBSP}min" if minutes and rest else format_duration(seconds)


def _draw_phases(phases: tuple[Phase, ...]) -> list[Block]:
    """Return the blocks; widths grow with the square root, so that 13 s are seen beside 10 min."""
    lengths = [phase_length_s(phase) for phase in phases]
    weights = [math.sqrt(length or OPEN_PHASE_S) for length in lengths]
    unit = WIDTH / (sum(weights) or 1)
    blocks, x = [], 0.0
    for phase, length, weight in zip(phases, lengths, weights, strict=True):
        width, height = weight * unit, HEIGHT if phase.feedback else LOW
        block = Block(
            round(x, 1),
            HEIGHT - height,
            round(max(width - 2, 1), 1),
            height,
            ("with" if phase.feedback else "without") + (" open" if length is None else ""),
        )
        blocks.append(block)
        x += width
    return blocks
