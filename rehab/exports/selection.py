"""Which sessions an export holds, and how their rows are read: page by page.

Rows are read in pages by key, so that neither memory nor the database holds more than a page while
a browser is slow. `visible_to` decides which rows a user may see; ``named`` says whether they may
hold anything but pseudonyms.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from typing import Any

from django.db.models import (
    Case,
    Count,
    F,
    OuterRef,
    Prefetch,
    QuerySet,
    Subquery,
    TextField,
    Value,
    When,
)
from django.db.models.functions import Cast, Coalesce

from rehab.people.models import User
from rehab.sessions.log import SessionEvent, SessionMetric, Step
from rehab.sessions.models import TrainingSession
from rehab.sessions.noted_conditions import CONDITIONS, RATED
from rehab.training.steps import InvalidReason

PAGE_ROWS = 2_000  # rows held in memory
SESSIONS_PAGE = 200


@dataclass(frozen=True)
class Selection:
    """Sessions that a user may see. ``named``: whether therapists and sources are named."""

    user: User
    sessions: QuerySet[TrainingSession]
    named: bool
    keys: list[int] = field(init=False)

    def __post_init__(self) -> None:
        keys = self.sessions.order_by("pk").values_list("pk", flat=True)
        object.__setattr__(self, "keys", list(keys))

    def read_sessions(self) -> Iterator[TrainingSession]:
        """Yield the sessions with their metrics, oldest first.

        ``late_strides`` of each: those of the trained leg that do not count as they came late.
        """
        metrics = Prefetch("metrics", SessionMetric.objects.visible_to(self.user))
        noted = SessionEvent.objects.visible_to(self.user).filter(
            kind__in=[kind.value for kind in (*CONDITIONS, *RATED)]
        )
        events = Prefetch("events", noted.order_by("pk").defer("data"), to_attr="walked_under")
        related = ("patient", "measure", "protocol")
        late = (
            Step.objects.visible_to(self.user)
            .filter(session=OuterRef("pk"), side=OuterRef("trained_side"), valid=False)
            .annotate(why=Cast("reasons", TextField()))
            .filter(why__contains=f'"{InvalidReason.LATE}"')
            .order_by()
            .values("session")
            .annotate(count=Count("pk"))
        )
        chosen = (
            self.sessions.select_related(*related).prefetch_related(metrics, events).order_by("pk")
        )
        chosen = chosen.annotate(late_strides=Coalesce(Subquery(late.values("count")), 0))
        for first in range(0, len(self.keys), SESSIONS_PAGE):
            yield from chosen.filter(pk__in=self.keys[first : first + SESSIONS_PAGE])

    @property
    def _who(self) -> Any:
        """The account that did something; by pseudonyms only that it was a person."""
        name = F("by__username")
        return name if self.named else Case(When(by__isnull=False, then=Value("person")))

    def read_pages(
        self, model: type[Any], session: TrainingSession, names: Sequence[str], key: str = "pk"
    ) -> Iterator[Any]:
        """Yield columns of a session's rows as named tuples, in the order of a unique key.

        The column ``who`` says who did it (their field ``by``).
        """
        rows = model.objects.visible_to(self.user).filter(session=session).order_by(key)
        if "who" in names:
            rows = rows.annotate(who=self._who)
        after: Any = None
        while True:
            rest = rows if after is None else rows.filter(**{f"{key}__gt": after})
            page = list(rest.values_list(*names, named=True)[:PAGE_ROWS])
            yield from page
            if len(page) < PAGE_ROWS:
                return
            after = getattr(page[-1], key)
