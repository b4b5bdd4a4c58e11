"""A tour of five minutes, which goes along on the pages themselves, from the start to a report.

Where somebody is in it stands in a cookie of the browser, which the page's script sets: -3 is a
tour that was left at its third step. It names nothing and nobody.
"""

from __future__ import annotations

import re
from typing import NamedTuple

from django.http import HttpRequest
from django.utils.functional import Promise
from django.utils.translation import gettext_lazy as _

from rehab.people.roles import Role

COOKIE = "garry_tour"


class Step(NamedTuple):
    """What a step says, and the pages that it is about, by the names of their addresses."""

    pages: frozenset[str]
    words: str | Promise


STEPS = (
    Step(
        frozenset({"start"}), _("Tap “Try a demo”: a simulated patient comes, who needs no sensor.")
    ),
    Step(
        frozenset({"patient"}),
        _("A set-up is suggested. Tap “Therapist’s page”; with a paired tablet the blue button."),
    ),
    Step(
        frozenset({"monitor"}),
        _("Tap “Start”. Each dot is a step; on the side of the goal that is wanted it is a hit."),
    ),
    Step(
        frozenset({"monitor"}),
        _("“Patient’s page” is what the patient sees at this moment, on a tablet or beside this."),
    ),
    Step(
        frozenset({"monitor"}),
        _("Change the goal by − and +: it holds from the next step on. “Stop robot” works always."),
    ),
    Step(
        frozenset({"monitor"}), _("Tap “End”. What was walked is stored; nothing has to be saved.")
    ),
    Step(
        frozenset({"session", "report", "patient"}),
        _("Report, figures and course of what was walked stay with the patient."),
    ),
    Step(
        frozenset(),
        _("Now your own: station, tablet, sensor, patient. “?” explains the page that you are on."),
    ),
)


def where_in_tour(request: HttpRequest) -> int:
    """Return the step, from 1 on; negative where the tour was left, 0 where there is none."""
    if getattr(request.user, "role", "") not in (Role.LEAD, Role.PT):  # whose start page it is
        return 0
    kept = request.COOKIES.get(COOKIE, "")
    number = int(kept) if re.fullmatch("-?[0-9]{1,2}", kept) else 0
    return number if abs(number) <= len(STEPS) else 0


def show_step(request: HttpRequest | None) -> dict[str, object]:
    """Return what the page shows of the tour: a later step, if the page is of a later one."""
    if request is None or (number := where_in_tour(request)) < 1:
        return {}
    page = request.resolver_match.url_name if request.resolver_match else None
    if page not in STEPS[number - 1].pages:
        later = (n for n in range(number, len(STEPS)) if page in STEPS[n].pages)
        number = next(later, number - 1) + 1
    return {
        "number": number,
        "count": len(STEPS),
        "words": STEPS[number - 1].words,
        "is_here": page in STEPS[number - 1].pages,
        "next": number + 1 if number < len(STEPS) else 0,
        "left": -number,
    }
