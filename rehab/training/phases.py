"""The phases of a session: what each is for, how long it lasts, whether it gives feedback."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

from rehab.training.measures import InvalidSetting, check_baseline_percent, check_gain
from robot.marking import gettext_noop

REST_MAX_S = 3600.0


@dataclass(frozen=True, slots=True)
class PhaseKind:
    """What a phase is for.

    Attributes
    ----------
    slug, label
        For programs, and for people (translated by pages).
    feedback
        Whether its phases give feedback by default.
    calm_words
        Text of the patient's screen in a phase without feedback.
    adapts
        Whether goals may follow the patient in its phases, where they have feedback.
    """

    slug: str
    label: str
    feedback: bool
    calm_words: str = gettext_noop("Just keep walking.")
    adapts: bool = False


# The lab's protocol (HEBB_03): baseline, familiarization, training blocks with catch blocks between
# them, washout. Retention is the same measurement on a later day.
PHASE_KINDS: dict[str, PhaseKind] = {
    kind.slug: kind
    for kind in (
        PhaseKind(
            "baseline",
            gettext_noop("Baseline"),
            False,
            gettext_noop("Just walk as you usually do."),
        ),
        PhaseKind("familiarization", gettext_noop("Familiarization"), True),
        PhaseKind("training", gettext_noop("Training"), True, adapts=True),
        PhaseKind(
            "catch", gettext_noop("Catch"), False, gettext_noop("Just walk as you usually do.")
        ),
        PhaseKind("washout", gettext_noop("Washout"), False),
        PhaseKind("retention", gettext_noop("Retention"), False),
    )
}


def find_phase_kind(slug: str) -> PhaseKind:
    """Return the phase kind of that slug. Raises InvalidSetting, naming the known ones."""
    try:
        return PHASE_KINDS[slug]
    except KeyError:
        raise InvalidSetting(
            "There is no phase kind {slug!r}. Known kinds: {known}.",
            slug=slug,
            known=", ".join(PHASE_KINDS),
        ) from None


@dataclass(frozen=True, slots=True)
class Phase:
    """One phase of a session.

    It ends after ``strides`` strides of the trained leg or ``seconds`` of source time, whichever
    comes first; with neither, when the PT moves on.

    Attributes
    ----------
    kind, name
        Slug of its kind, and what it is called.
    feedback
        Whether steps are rewarded, and shown.
    gain
        What the value is multiplied with before it is shown (ratio): the hidden decrement of the
        recorded protocols is a gain of 0.85 (docs/reference/gait.md#protocol).
    strides, seconds
        Its limits; None without.
    goal_percent
        Goal that it begins with, in percent of the baseline; None to leave the goal as it is.
    robot
        Whether the robot gets its steps.
    rest_s
        Planned length of the rest after it [s], which the PT ends; None for no rest.

    Raises
    ------
    InvalidSetting
        For a phase that cannot be walked.
    """

    kind: str
    name: str
    feedback: bool
    gain: float = 1.0
    strides: int | None = None
    seconds: float | None = None
    goal_percent: float | None = None
    robot: bool = True
    rest_s: float | None = None

    def __post_init__(self) -> None:
        find_phase_kind(self.kind)
        check_gain(self.gain)
        if self.strides is not None and self.strides < 1:
            raise InvalidSetting(
                "Phase {name!r} needs at least 1 stride, or no limit.", name=self.name
            )
        if self.seconds is not None and not (math.isfinite(self.seconds) and self.seconds > 0):
            raise InvalidSetting(
                "Phase {name!r} needs more than 0 seconds, or no limit.", name=self.name
            )
        if self.goal_percent is not None:
            check_baseline_percent(self.goal_percent)
        if self.rest_s is not None and not 0 < self.rest_s <= REST_MAX_S:
            raise InvalidSetting(
                "Phase {name!r}: a rest lasts more than 0 and up to {most:g} seconds; leave it "
                "empty for none.",
                name=self.name,
                most=REST_MAX_S,
            )

    @property
    def adapts(self) -> bool:
        """Whether goals may follow the patient in it."""
        return self.feedback and PHASE_KINDS[self.kind].adapts

    def is_over(self, strides: int, seconds: float) -> bool:
        """Return whether it has reached a limit.

        Parameters
        ----------
        strides, seconds
            Strides of the trained leg, and the source's time [s], since it began.
        """
        return (self.strides is not None and strides >= self.strides) or (
            self.seconds is not None and seconds >= self.seconds
        )


def make_phase(
    kind: str,
    name: str = "",
    *,
    feedback: bool | None = None,
    **settings: Any,
) -> Phase:
    """Return a phase.

    Parameters
    ----------
    kind
        Slug of its kind.
    name, feedback
        Those of its kind unless given.
    settings
        The other fields of ``Phase``.

    Raises
    ------
    InvalidSetting
        For a phase that cannot be walked.
    """
    known = find_phase_kind(kind)
    return Phase(
        kind, name or known.label, known.feedback if feedback is None else feedback, **settings
    )
