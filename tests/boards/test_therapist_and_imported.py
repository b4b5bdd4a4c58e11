"""What a therapist sees of a board of neighbors; imported sessions on the page of scores."""

from __future__ import annotations

import pytest

from rehab.boards.panels.own_sessions_panel import make_own_panel
from rehab.boards.panels.shared_panels import BoardViewer
from rehab.sessions.log import SessionMetric
from tests.support.boards import board_of, patient_of, people_of, walk_down
from tests.support.walks import strides, walk
from tests.support.world import NOW

pytestmark = pytest.mark.django_db


def test_a_therapist_sees_the_first_rows_of_a_board_of_neighbors(clinic):
    board = board_of(clinic)
    walk_down(people_of(clinic, 11))
    assert not BoardViewer(board, NOW).make_panel().rows  # a waiting tablet
    shown = BoardViewer(board, NOW, staff=True).make_panel()
    assert [(row.rank, row.value, row.you) for row in shown.rows] == [
        (rank, f"{105 - 5 * rank}\N{NO-BREAK SPACE}%", False) for rank in range(1, 6)
    ]


def test_an_imported_session_is_on_the_page_of_scores_by_its_points(clinic):
    person = patient_of(clinic, "A")
    old, new = (walk(person, "positive", strides(3 + n, 1)) for n in range(2))
    type(old).everywhere.filter(pk=old.pk).update(legacy_id=7)
    SessionMetric.everywhere.filter(session=old).exclude(slug="score").delete()
    same = make_own_panel(new, NOW)
    assert [row.value for row in same.rows] == ["4", "3"]
    assert [row.detail.endswith("· imported") for row in same.rows] == [False, True]
