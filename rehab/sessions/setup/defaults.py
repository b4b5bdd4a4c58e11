"""Rows of a new database: the measure A2 and the protocols that all clinics share.

They are stored in English and translated by the pages.
"""

from __future__ import annotations

from typing import Any

from django.db import transaction
from django.utils.translation import gettext_noop

from rehab.training.measures import A2
from rehab.training.phases import Phase, make_phase


def _catch(strides: int = 12) -> Phase:
    return make_phase("catch", strides=strides)


# The lab's sessions 2 and 3 (docs/reference/gait.md#protocol): a baseline of about a minute,
# training at full display, then ever longer blocks shown at 85 % with catch blocks between them,
# ten minutes of washout.
LAB_PROTOCOL: tuple[Phase, ...] = (
    make_phase("baseline", strides=54),
    make_phase("training", gettext_noop("Training 100 %"), seconds=57),
    *(
        phase
        for seconds in (57, 117, 117, 179, 239, 179)
        for phase in (
            _catch(),
            make_phase("training", gettext_noop("Training 85 %"), gain=0.85, seconds=seconds),
        )
    ),
    make_phase("washout", seconds=605),
)

PROTOCOLS: dict[str, tuple[str, tuple[Phase, ...]]] = {
    gettext_noop("Training only"): (
        gettext_noop(
            "Feedback from the first step until the therapist ends the session. Needs a goal value."
        ),
        (make_phase("training"),),
    ),
    gettext_noop("Baseline, training, washout"): (
        gettext_noop(
            "A minute without feedback sets the goal; ten minutes of training; two minutes without."
        ),
        (
            make_phase("baseline", strides=54),
            make_phase("training", seconds=600),
            make_phase("washout", seconds=120),
        ),
    ),
    gettext_noop("Thirty minutes with catch blocks"): (
        gettext_noop(
            "A laboratory protocol: the display shows 85 % of the real push, so that the goal asks "
            "for 118 % of the baseline; short blocks without feedback in between; a long washout."
        ),
        LAB_PROTOCOL,
    ),
}


def install_defaults(using: str = "default", **_signal: Any) -> None:
    """Add missing shared rows; existing ones are not changed."""
    from rehab.sessions.setup.protocols import Measure, Protocol, ProtocolPhase

    with transaction.atomic(using=using):
        Measure.everywhere.using(using).get_or_create(
            clinic=None,
            slug=A2.slug,
            defaults={
                "name": A2.name,
                "unit": A2.unit,
                "higher_is_better": A2.higher_is_better,
                "value_min": A2.value_min,
                "value_max": A2.value_max,
                "goal_min": A2.goal_min,
                "goal_max": A2.goal_max,
            },
        )
        for name, (description, phases) in PROTOCOLS.items():
            protocol, is_new = Protocol.everywhere.using(using).get_or_create(
                clinic=None, name=name, defaults={"description": description}
            )
            if is_new:
                ProtocolPhase.everywhere.using(using).bulk_create(
                    ProtocolPhase(
                        protocol=protocol,
                        position=position,
                        kind=phase.kind,
                        name=phase.name,
                        feedback=phase.feedback,
                        gain=phase.gain,
                        strides=phase.strides,
                        seconds=phase.seconds,
                    )
                    for position, phase in enumerate(phases, start=1)
                )
