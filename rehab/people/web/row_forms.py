"""Base classes of forms of a row: its clinic is set by the server, its fields are labeled."""

from __future__ import annotations

from typing import Any

from django import forms

from rehab.people.ranges import say_ranges


class MonthField(forms.DateField):
    """A month, stored as its first day."""

    widget = forms.DateInput(format="%Y-%m", attrs={"type": "month", "placeholder": "2026-03"})
    input_formats = ("%Y-%m", "%Y-%m-%d")


class LabeledFormSet(forms.BaseInlineFormSet):
    """Rows of a tabular inline whose fields are labeled for screen readers."""

    def add_fields(self, form: Any, index: int | None) -> None:
        """Label the fields."""
        super().add_fields(form, index)
        for field in form.fields.values():
            field.widget.attrs["aria-label"] = field.label


def with_values(form: Any, **values: Any) -> Any:
    """Return a class of forms like this one, whose new row has these values from the beginning."""

    class FormOfNewRow(form):  # type: ignore[misc]
        def __init__(self, *args: Any, **kwargs: Any) -> None:
            super().__init__(*args, **kwargs)
            if self.instance.pk is None:
                for name, value in values.items():
                    setattr(self.instance, name, value)

    return FormOfNewRow


class ClinicForm(forms.ModelForm):
    """A form of a row whose clinic is set by the server."""

    def __init__(self, *args: Any, **kwargs: Any) -> None:
        super().__init__(*args, **kwargs)
        say_ranges(self)

    def _get_validation_exclusions(self) -> set[str]:
        # The clinic is not in the form, but "once per clinic" must be checked all the same.
        return super()._get_validation_exclusions() - {"clinic"}  # type: ignore[misc, no-any-return]
