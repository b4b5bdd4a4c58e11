"""The valences of one session: as they are worded now, in force, and scheduled."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace

from rehab.training.changes import NotAllowed
from rehab.training.measures import InvalidSetting
from rehab.training.plans import SessionPlan
from rehab.training.valences import Valence, bands_from_json


@dataclass(slots=True)
class ValenceCourse:
    """Which valence a session is walked with, in its course.

    Attributes
    ----------
    plan
        The session's, with the valences that are possible.
    known
        By slug what may be in force, as it is worded now.
    current
        The one that is.
    next_slug
        The one that will be with the next phase that has feedback; empty for the same.
    switches
        After which step it changed to which.
    """

    plan: SessionPlan
    known: dict[str, Valence] = field(init=False)
    current: Valence = field(init=False)
    next_slug: str = ""
    switches: list[tuple[int, str]] = field(default_factory=list)

    def __post_init__(self) -> None:
        self.known = {one.slug: one for one in (self.plan.valence, *self.plan.alternatives)}
        self.current = self.plan.valence

    @property
    def changed_to(self) -> tuple[str, ...]:
        """The valences that the session was changed to, in that order, each once."""
        others = dict.fromkeys(slug for _, slug in self.switches)
        others.pop(self.plan.valence.slug, None)
        return tuple(others)

    @property
    def have_points(self) -> bool:
        """Whether any that was in force had points."""
        return self.plan.valence.has_points or any(
            self.known[slug].has_points for slug in self.changed_to
        )

    def begin_phase(self, after_number: int) -> None:
        """Put what is scheduled into force, with a phase that has feedback."""
        if self.next_slug:
            self.current = self.known[self.next_slug]
            self.next_slug = ""
            self.switches.append((after_number, self.current.slug))

    def schedule(self, slug: object, *, is_possible: bool) -> None:
        """Schedule the valence of the next phase with feedback; the current one cancels that.

        ``is_possible``: whether such a phase follows. Raises InvalidSetting and NotAllowed.
        """
        if not isinstance(slug, str) or slug not in self.known:
            raise InvalidSetting(
                "The feedback type of this session can be changed to one of: {known}.",
                known=", ".join(self.known),
            )
        if slug == self.current.slug:
            self.next_slug = ""
        elif is_possible:
            self.next_slug = slug
        else:
            raise NotAllowed(
                "The feedback type changes with a phase, and no phase with feedback follows. "
                "End this session and set up another one."
            )

    def edit_text(self, value: object) -> None:
        """Replace the bands of a valence. What a step earns stays as it was planned.

        Raises InvalidSetting.
        """
        given = value if isinstance(value, Mapping) else {}
        slug = given.get("valence")
        if not isinstance(slug, str) or slug not in self.known:
            raise InvalidSetting("Words are given with their valence, one of the session's.")
        worded = replace(self.known[slug], bands=bands_from_json(given.get("bands")))
        self.known[slug] = worded
        if self.current.slug == slug:
            self.current = worded
