"""Which outcomes were registered when, and every change of them since the first registration.

What was registered first stays what it was: a primary outcome that is replaced later is still
reported first, with the change beside it (CONSORT 2025, item 10).
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, fields
from datetime import datetime
from itertools import pairwise
from typing import Any

from django.utils.translation import gettext, ngettext

from rehab.studies.models import Study
from rehab.studies.participants import StudyEvent


@dataclass(frozen=True, slots=True)
class RegisteredOutcome:
    """An outcome with what it was when it was first registered as such.

    Attributes
    ----------
    slug, is_primary
        The outcome's; whether it ever was the primary one.
    since
        Number of the version that first named it as that.
    dropped_in
        Number of the first version that names it no more; None of one that is still named.
    """

    slug: str
    is_primary: bool
    since: int
    dropped_in: int | None = None

    @property
    def status(self) -> str:
        """What files call it."""
        role = "primary" if self.is_primary else "secondary"
        return role if self.since == 1 else f"later {role}"

    @property
    def status_text(self) -> str:
        """What people read beside its name; "" of a secondary outcome of the first version."""
        if self.since == 1:
            words = gettext("primary") if self.is_primary else ""
        elif self.is_primary:
            words = gettext("primary since version %(number)d") % {"number": self.since}
        else:
            words = gettext("secondary since version %(number)d") % {"number": self.since}
        if self.dropped_in is None:
            return words
        dropped = gettext("dropped in version %(number)d") % {"number": self.dropped_in}
        return f"{words}, {dropped}" if words else dropped


@dataclass(frozen=True, slots=True)
class OutcomeChange:
    """A version that names other outcomes than the version before.

    Attributes
    ----------
    version, at, reason
        Its number, when it was made and why.
    primary_before, primary_after, added, removed
        Slugs: of the primary outcomes, and of secondary ones that came and went.
    participants_before, looks_before
        How many had been enrolled, and how often results had been looked at (days and people).
    study
        Whose version it is.
    """

    version: int
    at: datetime
    reason: str
    primary_before: str
    primary_after: str
    added: tuple[str, ...]
    removed: tuple[str, ...]
    participants_before: int
    looks_before: int
    study: Study

    def to_row(self) -> dict[str, Any]:
        """Return its columns, as files have them."""
        return {name: getattr(self, name) for name in CHANGE_COLUMNS}

    def __str__(self) -> str:
        parts, name = [], self.study.outcome_label
        if self.primary_before != self.primary_after:
            change = {"before": name(self.primary_before), "after": name(self.primary_after)}
            parts.append(gettext("the primary outcome “%(before)s” became “%(after)s”") % change)
        if self.added:
            added = ", ".join(map(name, self.added))
            parts.append(gettext("secondary outcomes added: %(names)s") % {"names": added})
        if self.removed:
            removed = ", ".join(map(name, self.removed))
            parts.append(gettext("secondary outcomes removed: %(names)s") % {"names": removed})
        people = ngettext(
            "%(count)d participant", "%(count)d participants", self.participants_before
        )
        looks = ngettext("%(count)d look", "%(count)d looks", self.looks_before)
        words = gettext(
            "Version %(number)d, %(moment)s UTC: %(changes)s, after %(participants)s and %(looks)s "
            "at the results. Reason: %(reason)s"
        )
        return words % {
            "number": self.version,
            "moment": f"{self.at:%Y-%m-%d %H:%M}",
            "changes": "; ".join(parts),
            "participants": people % {"count": self.participants_before},
            "looks": looks % {"count": self.looks_before},
            "reason": self.reason,
        }


CHANGE_COLUMNS = tuple(one.name for one in fields(OutcomeChange) if one.name != "study")


def registered_outcomes(study: Study) -> tuple[RegisteredOutcome, ...]:
    """Return all outcomes that any version registered: primary ones first, each by its version."""
    versions = _documents(study)
    found: dict[str, RegisteredOutcome] = {}
    for number, document in versions:
        primary = document["primary_outcome"]
        if primary not in found or not found[primary].is_primary:
            found[primary] = RegisteredOutcome(primary, True, number)
        for slug in document["secondary_outcomes"]:
            found.setdefault(slug, RegisteredOutcome(slug, False, number))
    ordered = sorted(found.values(), key=lambda one: (not one.is_primary, one.since))
    return tuple(
        RegisteredOutcome(one.slug, one.is_primary, one.since, _dropped_in(one.slug, versions))
        for one in ordered
    )


def first_primary(study: Study) -> str:
    """Return the slug of the primary outcome that was registered first; of a draft, the planned."""
    versions = _documents(study)
    return str(versions[0][1]["primary_outcome"]) if versions else study.primary_outcome


def outcome_changes(study: Study) -> tuple[OutcomeChange, ...]:
    """Return the versions that changed outcomes, in their order."""
    return tuple(_changes(study))


def _changes(study: Study) -> Iterator[OutcomeChange]:
    for before, after in pairwise(study.versions.order_by("number")):
        old, new = before.document, after.document
        was, now = set(old["secondary_outcomes"]), set(new["secondary_outcomes"])
        if (old["primary_outcome"], was) == (new["primary_outcome"], now):
            continue
        looks = study.events.filter(kind=StudyEvent.Kind.LOOKED, at__lte=after.at)
        yield OutcomeChange(
            after.number,
            after.at,
            after.reason,
            old["primary_outcome"],
            new["primary_outcome"],
            tuple(sorted(now - was)),
            tuple(sorted(was - now)),
            study.enrollments.filter(enrolled_at__lte=after.at).count(),
            looks.count(),
            study,
        )


def _documents(study: Study) -> list[tuple[int, dict[str, Any]]]:
    return list(study.versions.order_by("number").values_list("number", "document"))


def _dropped_in(slug: str, versions: list[tuple[int, dict[str, Any]]]) -> int | None:
    names_it = [
        number
        for number, document in versions
        if slug in (document["primary_outcome"], *document["secondary_outcomes"])
    ]
    return next((number for number, _document in versions if number > names_it[-1]), None)
