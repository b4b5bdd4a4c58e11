"""The part of the set-up that says when page and robot answer, and whether the goal follows."""

from __future__ import annotations

from typing import Any

from django import forms
from django.utils.translation import gettext_lazy as _

from rehab.sessions.setup.answers import ADAPTATIONS, CUE_RULES, SCHEDULES, USUAL_ANSWERS
from rehab.training.cueing import COUNT_MAX, REST_MAX_S, WINDOW_MAX_S, WINDOW_MIN_S
from rehab.training.schedules import INTERVAL_MAX


class NumberField(forms.FloatField):
    """A number, with a point or a comma."""

    def to_python(self, value: Any) -> Any:
        """Return the number."""
        return super().to_python(value.replace(",", ".") if isinstance(value, str) else value)


class AnswerFields(forms.Form):
    """When robot and page answer. What is left empty is as usual."""

    robot_threshold = forms.IntegerField(
        label=_("Robot acts from, % of the goal"), min_value=1, max_value=200, required=False
    )
    robot_answers = forms.ChoiceField(label=_("Robot answers"), choices=CUE_RULES, required=False)
    robot_window = NumberField(
        label=_("Robot’s window, in seconds"),
        min_value=WINDOW_MIN_S,
        max_value=WINDOW_MAX_S,
        required=False,
    )
    robot_count = forms.IntegerField(
        label=_("Steps that the robot answers"), min_value=1, max_value=COUNT_MAX, required=False
    )
    robot_rest = NumberField(
        label=_("Robot’s rest, in seconds"), min_value=0, max_value=REST_MAX_S, required=False
    )
    schedule = forms.ChoiceField(label=_("Feedback comes"), choices=SCHEDULES, required=False)
    schedule_steps = forms.IntegerField(
        label=_("Steps between feedback"), min_value=1, max_value=INTERVAL_MAX, required=False
    )
    schedule_band = forms.IntegerField(
        label=_("Band without feedback, ± % of the goal"), min_value=1, max_value=50, required=False
    )
    goal_follows = forms.ChoiceField(label=_("The goal"), choices=ADAPTATIONS, required=False)
    goal_asks = forms.BooleanField(label=_("Ask before the baseline’s goal counts"), required=False)

    def chosen_answers(self) -> dict[str, Any]:
        """Return what was chosen, with the usual values for what was left empty."""
        given = {name: self.cleaned_data.get(name) for name in USUAL_ANSWERS}
        return USUAL_ANSWERS | {
            name: value for name, value in given.items() if value not in (None, "")
        }
