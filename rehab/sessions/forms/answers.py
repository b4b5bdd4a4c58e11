"""The part of the set-up that says when page and robot answer, and whether the goal follows."""

from __future__ import annotations

from typing import Any

from django import forms
from django.utils.translation import gettext_lazy as _

from rehab.people.ranges import NumberField, WholeNumberField
from rehab.sessions.setup.answers import ADAPTATIONS, CUE_RULES, SCHEDULES, USUAL_ANSWERS
from rehab.training.cueing import COUNT_MAX, REST_MAX_S, WINDOW_MAX_S, WINDOW_MIN_S
from rehab.training.schedules import INTERVAL_MAX


class AnswerFields(forms.Form):
    """When robot and page answer. What is left empty is as usual."""

    robot_threshold = WholeNumberField(
        label=_("Robot acts from, % of the goal"), least=1, most=200, unit="%", required=False
    )
    robot_answers = forms.ChoiceField(label=_("Robot answers"), choices=CUE_RULES, required=False)
    robot_window = NumberField(
        label=_("Robot’s window, in seconds"),
        least=WINDOW_MIN_S,
        most=WINDOW_MAX_S,
        unit="s",
        required=False,
    )
    robot_count = WholeNumberField(
        label=_("Steps that the robot answers"), least=1, most=COUNT_MAX, required=False
    )
    robot_rest = NumberField(
        label=_("Robot’s rest, in seconds"), least=0, most=REST_MAX_S, unit="s", required=False
    )
    schedule = forms.ChoiceField(label=_("Feedback comes"), choices=SCHEDULES, required=False)
    schedule_steps = WholeNumberField(
        label=_("Steps between feedback"), least=1, most=INTERVAL_MAX, required=False
    )
    schedule_band = WholeNumberField(
        label=_("Band without feedback, ± % of the goal"),
        least=1,
        most=50,
        unit="%",
        required=False,
    )
    goal_follows = forms.ChoiceField(label=_("The goal"), choices=ADAPTATIONS, required=False)
    goal_asks = forms.BooleanField(label=_("Ask before the baseline’s goal counts"), required=False)

    def chosen_answers(self) -> dict[str, Any]:
        """Return what was chosen, with the usual values for what was left empty."""
        given = {name: self.cleaned_data.get(name) for name in USUAL_ANSWERS}
        return USUAL_ANSWERS | {
            name: value for name, value in given.items() if value not in (None, "")
        }
