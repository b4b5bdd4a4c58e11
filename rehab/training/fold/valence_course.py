"""The valences of one session: as they are worded now, in force, and scheduled."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from itertools import zip_longest

from rehab.training.changes import NotAllowed
from rehab.training.feedback_bands import bands_from_json
from rehab.training.measures import InvalidSetting
from rehab.training.plans import SessionPlan
from rehab.training.valences import Valence


@dataclass(slots=True)
class ValenceCourse:
    """Which valence a session is walked with, step by step.

    Attributes
    ----------
    plan
        The session's, with the valences that are possible.
    known
        The valences that may be in force, by slug, with their present words.
    current
        The one in force.
    next_slug
        The one that the next phase with feedback begins with; empty for no change.
    switches
        After which step it changed to which.
    language
        Of the present words: the plan's, unless the patient's was changed since.
    """

    plan: SessionPlan
    language: str = field(init=False)
    known: dict[str, Valence] = field(init=False)
    current: Valence = field(init=False)
    next_slug: str = ""
    switches: list[tuple[int, str]] = field(default_factory=list)

    def __post_init__(self) -> None:
        self.language = self.plan.language
        self.known = {one.slug: one for one in (self.plan.valence, *self.plan.alternatives)}
        self.current = self.plan.valence

    @property
    def changed_to(self) -> tuple[str, ...]:
        """The valences that the session was changed to, in that order, each once.

        One that was replaced before a step came is left out: no step was walked with it.
        """
        steps = [after for after, _ in self.switches]
        others = dict.fromkeys(
            slug for (after, slug), until in zip_longest(self.switches, steps[1:]) if after != until
        )
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
            self.switch(self.next_slug, after_number)

    def switch(self, slug: object, after_number: int) -> None:
        """Change the valence from the next step on, which cancels a scheduled one.

        Parameters
        ----------
        slug
            The new valence: the plan's own or one of its alternatives.
        after_number
            Number of the last step that the old valence judges; 0 before the first step.

        Raises
        ------
        InvalidSetting
            For a valence that the plan does not have.
        """
        wanted = self._check(slug)
        self.next_slug = ""
        if wanted != self.current.slug:
            self.current = self.known[wanted]
            self.switches.append((after_number, wanted))

    def schedule(self, slug: object, *, is_possible: bool) -> None:
        """Schedule the valence of the next phase with feedback; the current one cancels that.

        Parameters
        ----------
        slug
            The valence: the plan's own or one of its alternatives.
        is_possible
            Whether a phase with feedback follows.

        Raises
        ------
        InvalidSetting
            For a valence that the plan does not have.
        NotAllowed
            Where no phase with feedback follows.
        """
        wanted = self._check(slug)
        if wanted == self.current.slug:
            self.next_slug = ""
        elif is_possible:
            self.next_slug = wanted
        else:
            raise NotAllowed(
                "No phase with feedback follows this one. Change the feedback type from the next "
                "stride on instead."
            )

    def edit_text(self, value: object) -> None:
        """Replace the bands of a valence, and the language of all words where one is given.

        What a step earns stays as it was planned. Raises InvalidSetting.
        """
        given = value if isinstance(value, Mapping) else {}
        slug = given.get("valence")
        if not isinstance(slug, str) or slug not in self.known:
            raise InvalidSetting("Words are given with their valence, one of the session's.")
        worded = replace(self.known[slug], bands=bands_from_json(given.get("bands")))
        self.known[slug] = worded
        self.language = str(given.get("language") or self.language)
        if self.current.slug == slug:
            self.current = worded

    def _check(self, slug: object) -> str:
        if not isinstance(slug, str) or slug not in self.known:
            raise InvalidSetting(
                "The feedback type of this session can be changed to one of: {known}.",
                known=", ".join(self.known),
            )
        return slug
