"""Rows of a new database: the measure A2 and the protocols that all clinics share.

They are stored in English and translated by the pages.
"""

from __future__ import annotations

from dataclasses import asdict
from typing import Any, NamedTuple

from django.db import transaction
from django.utils.translation import gettext_noop

from rehab.training.measures import MEASURES
from rehab.training.phases import Phase, make_phase


def _catch(strides: int = 12) -> Phase:
    return make_phase("catch", strides=strides)


def _training(percent: int, seconds: float) -> Phase:
    """Return a block that shows so many percent of the real push: the hidden decrement."""
    return make_phase(
        "training", TRAINING_NAMES[percent], gain=round(percent / 100, 2), seconds=seconds
    )


TRAINING_NAMES = {
    100: gettext_noop("Training 100 %"),
    95: gettext_noop("Training 95 %"),
    90: gettext_noop("Training 90 %"),
    85: gettext_noop("Training 85 %"),
}

# The lab's thirty minutes (docs/reference/gait.md#protocol): a baseline of about a minute, training
# at full display, then ever longer blocks shown at 85 % with catch blocks between them, ten minutes
# of washout. The first visit begins with a try of the feedback, and comes to 85 % by steps. Seconds
# are those of the sessions 1 and 2 of HEBB_03 with the pauses of 3 to 5 s between their trials,
# which count as walked; so both recordings have these phases, stride by stride.
FIRST_VISIT: tuple[Phase, ...] = (
    make_phase("baseline", strides=54),
    _catch(34),
    make_phase("familiarization", strides=30),
    _catch(7),
    _training(100, 60),
    _catch(),
    _training(95, 60),
    _catch(),
    _training(90, 121),
    _catch(),
    _training(85, 121),
    _catch(),
    _training(85, 183),
    _catch(13),
    _training(85, 242),
    _catch(13),
    _training(85, 182),
    make_phase("washout", seconds=610),
)
LATER_VISIT: tuple[Phase, ...] = (
    make_phase("baseline", strides=55),
    _training(100, 61),
    *(
        phase
        for seconds in (61, 121, 121, 182, 243, 183)
        for phase in (_catch(), _training(85, seconds))
    ),
    make_phase("washout", seconds=608),
)


class Template(NamedTuple):
    """A shared protocol: its description, its phases, and the share of hits it asks for [%]."""

    description: str
    phases: tuple[Phase, ...]
    wanted_hits: int | None = None


PROTOCOLS: dict[str, Template] = {
    gettext_noop("Training only"): Template(
        gettext_noop(
            "Feedback from the first step until the therapist ends the session. Needs a goal value."
        ),
        (make_phase("training"),),
    ),
    gettext_noop("Baseline, training, washout"): Template(
        gettext_noop(
            "A minute without feedback sets the goal; ten minutes of training; two minutes without."
        ),
        (
            make_phase("baseline", strides=54),
            make_phase("training", seconds=600),
            make_phase("washout", seconds=120),
        ),
    ),
    # The paper's example of a goal for a session (docs/reference/original.md#goal-of-a-session).
    gettext_noop("Ten minutes at 60 %"): Template(
        gettext_noop(
            "Ten minutes of feedback, in which six steps of ten should hit. Needs a goal value."
        ),
        (make_phase("training", seconds=600),),
        wanted_hits=60,
    ),
    gettext_noop("Thirty minutes with catch blocks"): Template(
        gettext_noop(
            "A laboratory protocol: the display shows 85 % of the real push, so that the goal asks "
            "for 118 % of the baseline; short blocks without feedback in between; a long washout."
        ),
        LATER_VISIT,
    ),
    gettext_noop("Thirty minutes with catch blocks, first visit"): Template(
        gettext_noop(
            "The same for someone who has never had feedback: a trial, then 100, 95, 90 and 85 %."
        ),
        FIRST_VISIT,
    ),
    gettext_noop("Retention visit"): Template(
        gettext_noop(
            "Two minutes without feedback show what has stayed, two with it how fast it comes "
            "back. Needs a goal value, that of the last visit."
        ),
        (make_phase("retention", seconds=120), make_phase("training", seconds=120)),
    ),
}


# What of a shared measure follows corrections in code. Another unit or direction is another
# measure, and gets a slug of its own: stored values have those of their day.
CORRECTED = ("name", "value_min", "value_max", "goal_min", "goal_max", "first_goal", "channel")


def install_defaults(using: str = "default", **_signal: Any) -> None:
    """Add missing shared rows, and let measures follow what was corrected in code.

    Sessions are scored by their own plans, registered studies by their own documents
    (`studies.registration.document`): neither changes.
    """
    from rehab.sessions.setup.protocol_models import MeasureDefinition, Protocol, ProtocolPhase

    with transaction.atomic(using=using):
        for slug, measure in MEASURES.items():
            row, is_new = MeasureDefinition.everywhere.using(using).get_or_create(
                clinic=None, slug=slug, defaults=asdict(measure)
            )
            corrected = {name: getattr(measure, name) for name in CORRECTED}
            if not is_new and corrected != {name: getattr(row, name) for name in CORRECTED}:
                for name, value in corrected.items():
                    setattr(row, name, value)
                row.save(using=using, update_fields=list(corrected))
        for name, template in PROTOCOLS.items():
            about = {"description": template.description, "wanted_hits": template.wanted_hits}
            protocol, is_new = Protocol.everywhere.using(using).get_or_create(
                clinic=None, name=name, defaults=about
            )
            if is_new:
                ProtocolPhase.everywhere.using(using).bulk_create(
                    ProtocolPhase(protocol=protocol, position=position, **asdict(phase))
                    for position, phase in enumerate(template.phases, start=1)
                )
