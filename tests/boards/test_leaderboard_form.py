"""A board that would rank by feedback type, or list a person twice, cannot be built."""

import pytest
from django.core.exceptions import ValidationError

from rehab.boards.models import Leaderboard
from rehab.people.models import Clinic

pytestmark = pytest.mark.django_db


def board(**fields) -> Leaderboard:
    clinic = Clinic.everywhere.get_or_create(name="Elm")[0]
    return Leaderboard(clinic=clinic, name="Steps at the goal", **fields)


def test_the_defaults_are_safe():
    made = board()
    made.full_clean()
    assert (made.among, made.metric, made.min_participants) == ("self", "hit_rate", 5)


@pytest.mark.parametrize(
    ("fields", "message"),
    [
        ({"metric": "score", "types": "all"}, "never above 0"),
        (
            {"metric": "score", "types": "chosen", "valences": ["positive", "negative"]},
            "never above",
        ),
        ({"metric": "score", "types": "chosen", "valences": ["explicit"]}, "has no points"),
        ({"types": "chosen"}, "at least one type"),
        ({"types": "chosen", "valences": ["kind"]}, "positive, negative, binary, explicit"),
        ({"valences": "positive"}, "Give a list"),
        ({"among": "clinic"}, "one row for each"),
        ({"min_participants": 3}, "greater than or equal to 5"),
        ({"period": "dates"}, "Give both dates"),
    ],
)
def test_a_board_that_would_mislead_is_refused(fields, message):
    with pytest.raises(ValidationError, match=message):
        board(**fields).full_clean()


def test_points_of_one_type_may_be_ranked():
    board(metric="score", types="chosen", valences=["binary"]).full_clean()
    board(metric="score", types="same").full_clean()
