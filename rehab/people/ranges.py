"""What numbers people may give, said whole and in the unit of the page: "Give 50 to 200 %."."""

from __future__ import annotations

from typing import Any

from django import forms
from django.core.validators import BaseValidator, MaxValueValidator, MinValueValidator
from django.utils.formats import number_format
from django.utils.functional import Promise
from django.utils.text import format_lazy
from django.utils.translation import gettext_lazy as _

Bound = float | None


def range_message(least: Bound, most: Bound, unit: str | Promise = "") -> Promise:
    """Return the lazy sentence that says which numbers are accepted."""
    given: dict[str, Any] = {"least": _Shown(least), "most": _Shown(most)}
    given["unit"] = "%%" if unit == "%" else unit  # Django fills the sentence in once more
    sentences = {
        (True, True, True): _("Give {least} to {most} {unit}."),
        (True, True, False): _("Give {least} to {most}."),
        (True, False, True): _("Give {least} {unit} or more."),
        (True, False, False): _("Give {least} or more."),
        (False, True, True): _("Give up to {most} {unit}."),
        (False, True, False): _("Give up to {most}."),
    }
    return format_lazy(sentences[least is not None, most is not None, bool(unit)], **given)


class _Shown:
    """A bound as the page's language writes it, when it is shown."""

    def __init__(self, bound: Bound) -> None:
        self._bound = bound

    def __format__(self, _spec: str) -> str:
        return number_format(f"{self._bound:.10g}")


class _AsDjango(BaseValidator):
    """To migrations a bound of Django's own: what is said of it is no part of a table."""

    def deconstruct(self) -> tuple[str, tuple[Any, ...], dict[str, Any]]:
        """Return how Django's validator is made."""
        (own,) = [base for base in type(self).__bases__ if base is not _AsDjango]
        return f"django.core.validators.{own.__name__}", (self.limit_value,), {}


class Least(_AsDjango, MinValueValidator):
    """The smallest number that is accepted."""


class Most(_AsDjango, MaxValueValidator):
    """The largest number that is accepted."""


def between(
    least: Bound = None, most: Bound = None, unit: str | Promise = ""
) -> list[BaseValidator]:
    """Return the validators of a range, whose message says all of it."""
    if least is None and most is None:
        return []
    message = range_message(least, most, unit)
    bounds: list[tuple[type[BaseValidator], Bound]] = [(Least, least), (Most, most)]
    return [kind(bound, message) for kind, bound in bounds if bound is not None]  # type: ignore[arg-type]


class _Ranged:
    """A field of numbers. The browser's own words on its range know no unit: it gets none."""

    def __init__(
        self, *, least: Bound = None, most: Bound = None, unit: str | Promise = "", **options: Any
    ) -> None:
        validators = between(least, most, unit)
        super().__init__(validators=validators, **options)  # type: ignore[call-arg]  # a field's

    def widget_attrs(self, widget: forms.Widget) -> dict[str, Any]:
        """Return what asks a phone for digits."""
        return {"inputmode": "decimal"}


class NumberField(_Ranged, forms.FloatField):
    """A number, with a point or a comma."""

    widget = forms.TextInput

    def to_python(self, value: Any) -> Any:
        """Return the number."""
        return super().to_python(value.replace(",", ".") if isinstance(value, str) else value)


class WholeNumberField(_Ranged, forms.IntegerField):
    """A whole number."""

    widget = forms.TextInput


def say_ranges(form: forms.ModelForm[Any]) -> None:
    """Let the fields of a form say the ranges of their model, also for what lies below zero."""
    columns = {column.name: column for column in form._meta.model._meta.fields}
    for name in form.fields.keys() & columns.keys():
        field: Any = form.fields[name]
        own = [each for each in columns[name].validators if isinstance(each, _AsDjango)]
        for validator in own:
            field.error_messages |= dict.fromkeys(("min_value", "max_value"), validator.message)
            for bound in ("min", "max"):
                field.widget.attrs.pop(bound, None)
