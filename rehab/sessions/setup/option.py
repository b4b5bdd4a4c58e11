"""What a set-up option is, and what follows from one: fields of forms, a part of the plan."""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass
from enum import StrEnum
from operator import attrgetter
from typing import Any, NamedTuple

from django import forms
from django.core.validators import BaseValidator
from django.utils.functional import Promise

from rehab.people.models import User
from rehab.people.ranges import NumberField, WholeNumberField, between
from rehab.sessions.formatting import MISSING, yes_or_no
from rehab.sessions.setup.walking_conditions import WalkingConditions
from rehab.training.changes import ChangeKind
from rehab.training.plans import SessionPlan

Choices = Sequence[tuple[Any, Any]]


class Group(StrEnum):
    """Where the set-up page shows an option."""

    MAIN = "main"  # a place of its own in the template
    GOAL = "goal"
    FEEDBACK = "feedback"
    ROBOT = "robot"
    WALKING = "walking"


class Conversion(NamedTuple):
    """How the value that people give becomes the plan's, and back. None stays None."""

    to_plan: Callable[[Any], Any]
    from_plan: Callable[[Any], Any]


AS_IS = Conversion(lambda given: given, lambda planned: planned)
PERCENT = Conversion(lambda given: given / 100, lambda ratio: round(100 * ratio))
MINUTES = Conversion(lambda given: 60 * given, lambda seconds: round(seconds / 60))


class OptionColumn(NamedTuple):
    """The column of exports that has an option's value, in the plan's unit."""

    name: str
    unit: str
    meaning: str


@dataclass(frozen=True, slots=True, kw_only=True)
class Option:
    """One thing that a therapist chooses when a session is set up.

    Attributes
    ----------
    name, api_name
        Its name in forms and presets; in the API, where that is another one.
    label, help
        What pages call it; what the API's description says of it.
    kind
        ``int``, ``float``, ``bool``, ``str``, or the StrEnum of its choices.
    default
        What the set-up offers a new patient; of an option that is not ``nullable`` also what holds
        where it is left empty.
    nullable
        Whether it may be left empty, and is None then.
    is_required
        Whether a form without it is refused.
    least, most, unit, max_length
        What may be given.
    choices
        Values with their labels, or a function that returns them for a user.
    is_radio
        Whether the choices are shown side by side.
    place
        Where its value stands, as a path from the plan or from ``walking``: "cue_timing.count".
    conversion
        Between the value that people give and the plan's.
    is_derived
        Whether its place is only read: the plan's part is built from other options too.
    control
        The kind of change that may alter it while the session is open.
    group, applies_to
        Where the set-up shows it; the option, with the values of it, that it belongs to.
    is_of_patient
        Whether it depends on the patient, so that no preset has it.
    column
        Of exports; None for an option that is not exported.
    """

    name: str
    label: str | Promise
    help: str
    kind: type = str
    default: Any = None
    api_name: str = ""
    nullable: bool = False
    is_required: bool = False
    least: float | None = None
    most: float | None = None
    unit: str | Promise = ""
    max_length: int | None = None
    choices: Choices | Callable[[User | None], Choices] = ()
    is_radio: bool = False
    place: str = ""
    conversion: Conversion = AS_IS
    is_derived: bool = False
    control: ChangeKind | None = None
    group: Group = Group.MAIN
    applies_to: tuple[str, Collection[str]] | None = None
    is_of_patient: bool = False
    column: OptionColumn | None = None

    @property
    def validators(self) -> list[BaseValidator]:
        """The validators of its range."""
        return between(self.least, self.most, self.unit)

    def choices_for(self, by: User | None) -> list[tuple[Any, Any]]:
        """Return the choices that a user has."""
        return list(self.choices(by) if callable(self.choices) else self.choices)

    def to_field(self, by: User | None = None) -> forms.Field:
        """Return its field of a form that a user fills in."""
        options: dict[str, Any] = {"label": self.label, "required": self.is_required}
        if self.choices:
            if self.is_radio:
                options["widget"] = forms.RadioSelect
            return forms.ChoiceField(choices=self.choices_for(by), **options)
        if self.kind is bool:
            return forms.BooleanField(**options)
        if self.kind is str:
            return forms.CharField(max_length=self.max_length, **options)
        number = WholeNumberField if self.kind is int else NumberField
        return number(least=self.least, most=self.most, unit=self.unit, **options)

    def get(self, plan: SessionPlan, walking: WalkingConditions | None = None) -> Any:
        """Return its value in the unit of the plan; None where it stands in neither of the two."""
        root, _between, path = self.place.partition(".")
        if not root or (root == "walking" and walking is None):
            return None
        found = attrgetter(path)(walking) if root == "walking" else attrgetter(self.place)(plan)
        return found.value if isinstance(found, StrEnum) else found

    def read(
        self,
        plan: SessionPlan,
        walking: WalkingConditions | None = None,
        changes: Mapping[str, Any] | None = None,
    ) -> Any:
        """Return its value as people give it.

        Parameters
        ----------
        plan, walking
            Of a session.
        changes
            The last value of each kind of change in that session's log.
        """
        planned = self.get(plan, walking)
        if self.control is not None and changes:
            planned = changes.get(self.control.value, planned)
        return None if planned is None else self.conversion.from_plan(planned)

    def describe(self, value: Any) -> str:
        """Return a value that people gave as text."""
        if isinstance(value, bool):
            return yes_or_no(value)
        if value in (None, ""):
            return MISSING
        return str(dict(self.choices_for(None)).get(value, value))

    def complete(self, given: Any) -> Any:
        """Return a given value; for one that was left empty the default, or None."""
        if given in (None, "") and not self.is_required:
            return None if self.nullable else self.default
        return given


class OptionForm(forms.Form):
    """A form whose fields are options."""

    def __init__(
        self, *args: Any, options: Collection[Option], by: User | None = None, **others: Any
    ) -> None:
        super().__init__(*args, **others)
        self.options = options
        self.fields |= {option.name: option.to_field(by) for option in options}

    def chosen(self) -> dict[str, Any]:
        """Return what was chosen, once the form is valid; what was left empty is as usual."""
        data = self.cleaned_data
        return {option.name: option.complete(data.get(option.name)) for option in self.options}
