"""API calls about leaderboards: their settings, and what a patient would see on them."""

from __future__ import annotations

from typing import Any

from django.http import HttpRequest
from django.shortcuts import get_object_or_404
from django.utils import timezone
from ninja import Path, Query, Router, Schema

from rehab.boards.models import Leaderboard
from rehab.boards.panels.panel_rows import BoardPanel
from rehab.boards.panels.shared_panels import BoardViewer, make_session_panels
from rehab.people.access import for_roles
from rehab.people.roles import Role
from rehab.people.web.api_base import Key, Page, Paging, caller, paginate, responses
from rehab.sessions.models import TrainingSession

router = Router(tags=["Boards"])


class BoardOut(Schema):
    """A board's settings."""

    id: int
    name: str
    active: bool
    among: str
    metric: str
    aggregation: str
    types: str
    period: str
    display: str
    occasion: str


class RowOut(Schema):
    """A row, formatted as on the page."""

    rank: int | None
    title: str
    value: str
    points_at_stake: str
    detail: str
    you: bool


class BoardPanelOut(Schema):
    """A board as it is shown. `note` says why it shows own sessions instead."""

    title: str
    note: str
    shared: bool
    total: str | None
    rows: list[RowOut]

    @staticmethod
    def resolve_total(panel: BoardPanel) -> str | None:
        """Return what all have reached together, on boards of totals."""
        return None if panel.total is None else panel.total.value


@router.get("/boards", response=responses(Page[BoardOut]))
@for_roles(Role.LEAD, Role.PT, Role.RESEARCHER, patients=False)
def list_boards(request: HttpRequest, paging: Query[Paging]) -> dict[str, Any]:
    """List the clinic's leaderboards."""
    return paginate(Leaderboard.objects.visible_to(caller(request)).order_by("pk"), paging)


@router.get("/boards/{board_id}/rows", response=responses(BoardPanelOut, 404))
@for_roles(Role.LEAD, Role.PT)
def show_board(request: HttpRequest, board_id: Path[Key]) -> BoardPanel:
    """Show a board as tablets show it to anybody, with the patients who agreed to be on it.

    Of a board that shows each patient their neighbors, its first rows; of one with a list for each
    feedback type, the longest list.
    """
    boards = Leaderboard.objects.visible_to(caller(request)).select_related("clinic")
    board = get_object_or_404(boards, pk=board_id)
    return BoardViewer(board, timezone.now(), staff=True).make_panel()


@router.get("/sessions/{session_id}/boards", response=responses(list[BoardPanelOut], 404))
@for_roles(Role.LEAD, Role.PT)
def list_session_boards(request: HttpRequest, session_id: Path[Key]) -> list[BoardPanel]:
    """Show the boards that the patient sees after a session."""
    sessions = TrainingSession.objects.visible_to(caller(request))
    session = get_object_or_404(sessions.select_related("patient", "clinic"), pk=session_id)
    return make_session_panels(session, timezone.now())
