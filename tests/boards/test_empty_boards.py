"""An empty board says which of its settings leaves all walks out, on the tablet and in the form."""

from __future__ import annotations

from datetime import timedelta

import pytest
from django.urls import reverse

from rehab.boards.models import Leaderboard
from rehab.boards.panels.shared_panels import BoardViewer
from rehab.people.models import BoardsConsent, Patient
from tests.support.clock import START as NOW
from tests.support.walks import walk

pytestmark = pytest.mark.django_db
STEPS = [4.0] * 20


def panel(patient, **fields):
    board = Leaderboard(clinic=patient.clinic, name="Own", **fields)
    return BoardViewer(board, NOW, patient).make_panel()


@pytest.fixture
def patient(world):
    return Patient.everywhere.create(
        clinic=world.clinic, code="new", nickname="Ada", paretic_side="left"
    )


@pytest.mark.parametrize(
    ("walked", "fields", "told"),
    [
        ({}, {}, "fewer than 100 steps"),
        ({"simulated": True}, {"min_valid_strides": 5}, "Simulated walks"),
        ({"days_ago": 40}, {"min_valid_strides": 5}, "from before"),
        (
            {},
            {"min_valid_strides": 5, "types": "chosen", "valences": ["explicit"]},
            "other feedback",
        ),
        ({"simulated": True}, {}, "Several of its settings"),
    ],
    ids=["short", "simulated", "before", "type", "several"],
)
def test_the_setting_is_named_that_leaves_all_out(patient, walked, fields, told):
    walk(patient, "binary", STEPS, now=NOW - timedelta(hours=2), **walked)
    shown = panel(patient, **fields)
    assert not shown.rows
    assert told in shown.nothing
    assert shown.summary == shown.nothing


def test_where_nothing_was_walked_no_setting_is_blamed(patient):
    assert panel(patient).nothing == ""


def test_the_preview_of_a_shared_board_says_why_nobody_is_on_it(world, patient):
    Patient.everywhere.filter(clinic=world.clinic).update(boards=BoardsConsent.OWN)
    given = {
        "name": "All", "among": "clinic", "metric": "hit_rate", "aggregation": "best",
        "types": "all", "min_valid_strides": 100, "period": "days_30", "display": "neighbors",
        "top_n": 10, "ties": "standard", "names": "pseudonym", "min_participants": 5,
        "occasion": "after_session", "mean_of": 3, "higher_is_better": "on",
    }  # fmt: skip
    address = reverse("admin:rehab_leaderboard_preview")
    assert "Nobody has agreed to be on it yet." in world.pt.get(address, given).content.decode()
    alone = given | {"among": "self", "min_valid_strides": 10_000, "aggregation": "each"}
    page = world.pt.get(address, alone).content.decode()
    assert "An example. Walks of fewer than" in page
    assert "Session 3" in page
    Patient.everywhere.filter(pk=patient.pk).update(boards=BoardsConsent.CLINIC, simulated=True)
    walk(patient, "binary", STEPS, now=NOW - timedelta(hours=2))
    page = world.pt.get(address, given).content.decode()
    assert "Walks of fewer than 100 steps do not count here." in page
