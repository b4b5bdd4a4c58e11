"""What narrows the list of sessions with one tap: type, period, and whether somebody walked."""

from __future__ import annotations

from collections.abc import Iterator
from datetime import timedelta
from typing import Any

from django.contrib.admin import BooleanFieldListFilter, ChoicesFieldListFilter, SimpleListFilter
from django.db.models import QuerySet
from django.http import HttpRequest
from django.utils import timezone
from django.utils.functional import Promise
from django.utils.text import capfirst
from django.utils.translation import gettext_lazy as _

from rehab.people.simulated import counted
from rehab.sessions.reports.insight import PERIODS

CHIPS = "admin/chips.html"


class _ChoiceChips(ChoicesFieldListFilter):
    """A field's choices beside each other, after ``everything``."""

    template = CHIPS
    everything: str | Promise

    def choices(self, changelist: Any) -> Iterator[Any]:
        """Return all, then each."""
        first, *others = super().choices(changelist)
        yield {**first, "display": self.everything}
        yield from others


class TypeFilter(_ChoiceChips):
    """The feedback types."""

    everything = _("All types")


class StateFilter(_ChoiceChips):
    """Whether it is planned, runs, is paused or has ended."""

    everything = _("All states")


class LeftOutFilter(BooleanFieldListFilter):
    """Whether a correction took it out of figures."""

    template = CHIPS

    def choices(self, changelist: Any) -> Iterator[Any]:
        """Return both, those left out, those that count."""
        words = (_("All"), _("Left out"), _("Counted"))
        for choice, display in zip(super().choices(changelist), words, strict=True):
            yield {**choice, "display": display}


class PeriodFilter(SimpleListFilter):
    """The last weeks."""

    title = _("Period")
    parameter_name = "weeks"
    template = CHIPS

    def lookups(self, request: HttpRequest, model_admin: Any) -> list[tuple[str, Any]]:
        """Return the periods in weeks."""
        return [(weeks, capfirst(label)) for weeks, label in PERIODS.items() if weeks]

    def choices(self, changelist: Any) -> Iterator[Any]:
        """Return all time, then the periods."""
        first, *others = super().choices(changelist)
        yield {**first, "display": PERIODS[""]}
        yield from others

    def queryset(self, request: HttpRequest, queryset: QuerySet[Any]) -> QuerySet[Any]:
        """Return the period's sessions."""
        weeks = self.value()
        if not weeks or weeks not in PERIODS:
            return queryset
        return queryset.filter(created_at__gte=timezone.now() - timedelta(weeks=int(weeks)))


class SimulatedFilter(SimpleListFilter):
    """Whether sessions that nobody walked are shown as well; they are not unless asked for."""

    title = _("Simulated")
    parameter_name = "also"
    template = "admin/switch.html"  # the choice that is not in force

    def lookups(self, request: HttpRequest, model_admin: Any) -> list[tuple[str, Any]]:
        """Return the one that is asked for."""
        return [("simulated", _("Show simulated"))]

    def choices(self, changelist: Any) -> Iterator[Any]:
        """Return the usual choice, then the other."""
        first, *others = super().choices(changelist)
        yield {**first, "display": _("Hide simulated")}
        yield from others

    def queryset(self, request: HttpRequest, queryset: QuerySet[Any]) -> QuerySet[Any]:
        """Return the sessions."""
        return queryset if self.value() == "simulated" else queryset.filter(counted())
