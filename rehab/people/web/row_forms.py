"""Base classes of forms of a row: its clinic is set by the server, its fields are labeled."""

from __future__ import annotations

from typing import Any, ClassVar

from django import forms

from rehab.people.ranges import say_ranges


class LabeledFormSet(forms.BaseInlineFormSet):
    """Rows of a tabular inline whose fields are labeled for screen readers."""

    def add_fields(self, form: Any, index: int | None) -> None:
        """Label the fields."""
        super().add_fields(form, index)
        for field in form.fields.values():
            field.widget.attrs["aria-label"] = field.label


class ClinicForm(forms.ModelForm):
    """A form of a row whose clinic is set by the server."""

    new_clinic_id: ClassVar[int | None] = None

    def __init__(self, *args: Any, **kwargs: Any) -> None:
        super().__init__(*args, **kwargs)
        if self.instance.pk is None and getattr(self.instance, "clinic_id", 0) is None:
            self.instance.clinic_id = self.new_clinic_id
        say_ranges(self)

    def _get_validation_exclusions(self) -> set[str]:
        # The clinic is not in the form, but "once per clinic" must be checked all the same.
        return super()._get_validation_exclusions() - {"clinic"}  # type: ignore[misc, no-any-return]
