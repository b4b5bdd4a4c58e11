"""The search form of sessions in the admin: by day, patient, station and figures."""

from __future__ import annotations

from collections.abc import Iterator
from datetime import date, datetime, time, timedelta
from typing import Any
from zoneinfo import ZoneInfo

from django import forms
from django.conf import settings
from django.contrib.admin import ListFilter
from django.core.exceptions import ValidationError
from django.core.validators import MaxValueValidator, MinValueValidator
from django.db.models import QuerySet
from django.db.models.functions import Coalesce
from django.http import HttpRequest
from django.utils.translation import gettext
from django.utils.translation import gettext_lazy as _

from rehab.people.access import user_of
from rehab.people.models import Patient, User
from rehab.people.ranges import NumberField
from rehab.people.roles import may_see_names
from rehab.sessions.models import TrainingSession
from rehab.stations.models import Station

# Name in the form → column, and how many units of the form are one unit of the column.
RANGES = {"score": ("metric_score", 1), "hits": ("metric_hit_rate", 100), "goal": ("goal", 1)}

# Limits that leave room for a day more or less, in every time zone.
FIRST_DAY, LAST_DAY = date(1900, 1, 1), date(2999, 12, 31)
NO_DAY = _("Give a day of the years 1900 to 2999.")
DAYS = [MinValueValidator(FIRST_DAY, NO_DAY), MaxValueValidator(LAST_DAY, NO_DAY)]


class SessionSearchForm(forms.Form):
    """What sessions are searched by. Everything may be left empty."""

    first = forms.DateField(required=False, validators=DAYS, label=_("First day"))
    last = forms.DateField(required=False, validators=DAYS, label=_("Last day"))
    place: forms.ModelChoiceField[Station] = forms.ModelChoiceField(
        queryset=None, required=False, label=_("Station"), empty_label=_("Any station")
    )
    score_min = NumberField(required=False, label=_("Score from"))
    score_max = NumberField(required=False, label=_("Score to"))
    hits_min = NumberField(required=False, least=0, most=100, unit="%", label=_("Hits from, %"))
    hits_max = NumberField(required=False, least=0, most=100, unit="%", label=_("Hits to, %"))
    goal_min = NumberField(required=False, least=0, label=_("Goal from"))
    goal_max = NumberField(required=False, least=0, label=_("Goal to"))

    def __init__(self, *args: Any, by: User, **options: Any) -> None:
        super().__init__(*args, **options | {"auto_id": "find_%s"})
        fields: dict[str, Any] = self.fields
        for name in ("first", "last"):
            fields[name].widget = forms.DateInput(attrs={"type": "date"}, format="%Y-%m-%d")
        fields["place"].queryset = Station.objects.visible_to(by)
        if not may_see_names(by.role):
            del fields["place"]
            walkers = TrainingSession.objects.visible_to(by).order_by("patient__pseudonym")
            names = walkers.values_list("patient__pseudonym", flat=True).distinct()
            fields["who"] = forms.ChoiceField(
                required=False,
                label=_("Patient"),
                choices=lambda: [("", _("Anybody")), *((name, name) for name in names)],
            )
        else:
            fields["who"] = forms.ModelChoiceField(
                Patient.objects.visible_to(by),
                required=False,
                label=_("Patient"),
                empty_label=_("Anybody"),
            )

    def clean(self) -> dict[str, Any]:
        """Return the cleaned data. Refuses ranges that begin after their end."""
        data: dict[str, Any] = super().clean() or {}
        over = gettext("The first number must not be larger than the second.")
        problems = {("first", "last"): gettext("It ends before it starts.")} | {
            (f"{name}_min", f"{name}_max"): over for name in RANGES
        }
        for (low, high), problem in problems.items():
            start, end = data.get(low), data.get(high)
            if start is not None and end is not None and start > end:
                self.add_error(high, ValidationError(problem))
        return data

    def filter_sessions(self, sessions: QuerySet[Any], zone: str) -> QuerySet[Any]:
        """Return the sessions that match; ``zone`` is the time zone of the days."""
        data = self.cleaned_data
        begun: QuerySet[Any] = sessions.annotate(begun=Coalesce("started_at", "created_at"))
        if data["first"]:
            begun = begun.filter(begun__gte=_midnight(data["first"], zone))
        if data["last"]:
            begun = begun.filter(begun__lt=_midnight(data["last"] + timedelta(days=1), zone))
        if data["who"]:
            by_name = isinstance(data["who"], Patient)
            begun = begun.filter(**{"patient" if by_name else "patient__pseudonym": data["who"]})
        if data.get("place"):
            begun = begun.filter(station=data["place"])
        for name, (column, units) in RANGES.items():
            for end, lookup in (("min", "gte"), ("max", "lte")):
                value = data[f"{name}_{end}"]
                if value is not None:
                    begun = begun.filter(**{f"{column}__{lookup}": value / units})
        return begun


def _midnight(day: Any, zone: str) -> datetime:
    return datetime.combine(day, time(), ZoneInfo(zone))


class SessionSearchFilter(ListFilter):
    """The form as a filter of the admin. With an invalid form, errors and no sessions are shown."""

    title = _("what was walked")
    template = "admin/search_filter.html"

    def __init__(
        self, request: HttpRequest, params: dict[str, list[str]], model: type[Any], model_admin: Any
    ) -> None:
        super().__init__(request, params, model, model_admin)
        user = user_of(request)
        self.zone = user.clinic.time_zone if user.clinic else settings.TIME_ZONE
        names = [name for name in SessionSearchForm(by=user).fields if name in params]
        given = {name: params.pop(name)[-1].strip() for name in names}
        self.used_parameters = {name: value for name, value in given.items() if value}
        self.form = SessionSearchForm(given or None, by=user)
        self.others: list[tuple[str, str]] = []

    def has_output(self) -> bool:
        """Return True: the form is always shown."""
        return True

    def expected_parameters(self) -> list[str | None]:
        """Return the names of the form's fields."""
        return list(self.form.fields)

    def choices(self, changelist: Any) -> Iterator[Any]:
        """Return no links; store the other filters, which the form sends along."""
        mine = {*self.expected_parameters(), "p", "e"}
        self.others = [(name, v) for name, v in changelist.params.items() if name not in mine]
        return iter(())

    def queryset(self, request: HttpRequest, queryset: QuerySet[Any]) -> QuerySet[Any]:
        """Return the sessions that match; none for an invalid form."""
        if not self.used_parameters:
            return queryset
        return (
            self.form.filter_sessions(queryset, self.zone)
            if self.form.is_valid()
            else queryset.none()
        )

    @property
    def groups(self) -> list[tuple[Any, list[Any]]]:
        """The fields as they are laid out: single, or two of a range under one heading."""
        form = self.form
        alone = [(None, [form[name]]) for name in ("who", "place") if name in form.fields]
        return [
            (_("First and last day"), [form["first"], form["last"]]),
            *alone,
            (_("Score"), [form["score_min"], form["score_max"]]),
            (_("Hit rate, %"), [form["hits_min"], form["hits_max"]]),
            (_("Goal"), [form["goal_min"], form["goal_max"]]),
        ]
