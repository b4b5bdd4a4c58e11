"""The tenancy matrix can fail: leaks are planted, and it finds them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import pytest
from django.db.models import Q
from django.http import HttpRequest, HttpResponse
from django.urls import path, reverse
from django.views.decorators.http import require_POST

from rehab.boards.panels import panel_rows
from rehab.boards.ranking import results
from rehab.people.access import for_roles, public
from rehab.people.audit import row_history
from rehab.people.audit.history import HistoryEntry
from rehab.people.models import Patient
from rehab.people.roles import Role
from rehab.people.scope import Scope
from rehab.people.web import admin_base
from rehab.people.web.admin_base import ScopedOptions
from rehab.sessions import api as sessions_api
from rehab.sessions import corrections
from tests.support.foreign_writes import find_foreign_writes
from tests.support.tenancy import (
    add_routes,
    all_routes,
    find_leaks,
    find_offers,
    researchers,
    some_actors,
    undeclared_views,
)
from tests.support.world import (
    scoped_models,
    signed_in,
)

pytestmark = pytest.mark.django_db


@dataclass(frozen=True)
class NoScope(Scope):
    """A scope that somebody forgot: rights hold, clinics do not."""

    def clinic_filter(self, clinic_id: int) -> Q:
        return Q()


# Models that have pages, and where at least the matrix must find them shown to another clinic.
SHOWN_UNDER = {
    "/admin/": {
        "Patient",
        "Station",
        "Device",
        "MeasureDefinition",
        "Protocol",
        "ComposedGesture",
        "Leaderboard",
    }
    | {"TrainingSession", "ProtocolPhase", "User", "ApiToken"},
    "/api/v1/": {"Patient", "Station", "Protocol", "Leaderboard"},
    "/admin/autocomplete/": {"Patient", "User"},
    "/patients": {"Patient"},
    "/sessions": {"Patient"},
}


@pytest.mark.long
def test_a_forgotten_scope_is_caught_wherever_it_shows(worlds, monkeypatch):
    """Every model without its scope at once: the matrix says so of admin, API and pages."""
    for model in scoped_models():
        old = model.scope
        monkeypatch.setattr(model, "scope", NoScope(old.clinic, old.station, old.shared, old.host))
    eyes = some_actors(worlds, "lead of birch", "pt of birch")
    leaks, counts = find_leaks(worlds, eyes)
    for under, models in SHOWN_UNDER.items():
        found = {
            leak.partition(" shows ")[2].partition(" ")[0]
            for leak in leaks
            if f": {under}" in leak and leak.endswith("of amber")
        }
        assert models <= found, (under, sorted(models - found))
    opened = {leak.split()[3] for leak in leaks if leak.endswith(" opens")}
    assert len(opened) > 20
    assert set(counts) == {actor.label for actor in eyes}


@pytest.mark.long
def test_a_picker_of_every_row_is_caught(worlds, monkeypatch):
    def offer_all(self: Any, db: Any, db_field: Any, request: HttpRequest) -> Any:
        return db_field.remote_field.model.everywhere.all()

    monkeypatch.setattr(ScopedOptions, "get_field_queryset", offer_all)
    actors = some_actors(worlds, "pt of amber")
    assert (
        "pt of amber: Leaderboard.group offers Patient of birch" in find_offers(worlds, actors)[0]
    )
    leaks, _ = find_leaks(worlds, actors, under="/admin/rehab/leaderboard/add/")
    assert "pt of amber: /admin/rehab/leaderboard/add/ shows Patient of birch" in leaks


def test_an_unscoped_admin_queryset_is_caught(worlds, monkeypatch):
    monkeypatch.setattr(
        ScopedOptions, "get_queryset", lambda self, request: self.model.everywhere.all()
    )
    leaks, _ = find_leaks(worlds, some_actors(worlds, "pt of birch"), under="/admin/rehab/patient/")
    assert "pt of birch: /admin/rehab/patient/ shows Patient of amber" in leaks


def test_an_unscoped_page_is_caught(worlds, settings):
    @for_roles(Role.PT)
    def leaky(request: HttpRequest) -> HttpResponse:
        return HttpResponse(", ".join(str(patient) for patient in Patient.everywhere.all()))

    add_routes(settings, path("leaky", leaky, name="leaky"))
    leaks, _ = find_leaks(
        worlds, some_actors(worlds, "pt of amber", "researcher of amber"), under="/leaky"
    )
    assert "pt of amber: /leaky shows Patient of birch" in leaks
    assert not any("researcher" in leak for leak in leaks)  # the role table held


def test_a_public_page_with_patients_is_caught(worlds, settings):
    @public
    def leaky(request: HttpRequest) -> HttpResponse:
        return HttpResponse(str(Patient.everywhere.first()))

    add_routes(settings, path("leaky", leaky, name="leaky"))
    leaks, _ = find_leaks(worlds, some_actors(worlds, "stranger"), under="/leaky")
    assert "stranger: /leaky shows Patient of amber" in leaks


def test_rows_of_another_clinics_board_are_caught(worlds, monkeypatch):
    for module in (results, panel_rows):
        monkeypatch.setattr(module, "eligible_patients", lambda board: Patient.everywhere.all())
    leaks, _ = find_leaks(worlds, some_actors(worlds, "pt of amber"), under="/sessions/")
    url = reverse("scores", kwargs={"session_id": worlds[0].session.pk})
    assert f"pt of amber: {url} shows Patient of birch" in leaks


@pytest.mark.long
def test_persons_beside_a_row_that_a_researcher_reads_are_caught(worlds, monkeypatch):
    monkeypatch.setattr(admin_base, "hidden_fields", lambda request, model: set())
    leaks, _ = find_leaks(worlds, researchers(worlds), under="/admin/rehab/")
    board = worlds[0].more[0].pk
    told = "researcher of amber: /admin/rehab/"
    assert f"{told}leaderboard/{board}/change/ names a patient by nickname" in leaks
    assert f"{told}sessionevent/ names a pt" in leaks


@pytest.mark.long
def test_staff_in_a_history_and_beside_a_session_is_caught(worlds, monkeypatch):
    board = worlds[0].more[0]
    who = {"by": worlds[0].people[Role.PT], "clinic": worlds[0].clinic, "object_id": board.pk}
    HistoryEntry.everywhere.create(model_name="Leaderboard", kind="changed", **who)
    researcher = researchers(worlds)
    assert find_leaks(worlds, researcher, under="/admin/rehab/leaderboard/")[0] == []
    monkeypatch.setattr(row_history, "may_see_names", lambda role: True)
    monkeypatch.setattr(corrections, "may_see_names", lambda role: True)
    leaks, _ = find_leaks(worlds, researcher)
    url = reverse("admin:rehab_leaderboard_history", args=[board.pk])
    assert f"researcher of amber: {url} names a pt" in leaks
    url = reverse("session", args=[worlds[0].session.pk])
    assert f"researcher of amber: {url} names a pt" in leaks


def test_a_pseudonym_for_a_number_is_caught(worlds, monkeypatch):
    monkeypatch.setattr(sessions_api, "get_object_or_404", lambda *found, **by: None)
    leaks, _ = find_leaks(worlds, researchers(worlds), under="/api/v1/sessions")
    url = f"/api/v1/sessions?patient={worlds[0].patient.pk}"
    assert f"researcher of amber: {url} opens" in leaks


def test_a_page_that_declares_nothing_is_closed_and_caught(worlds, settings):
    def silent(request: HttpRequest) -> HttpResponse:
        return HttpResponse("open")

    add_routes(settings, path("silent", silent, name="silent"))
    client = signed_in(worlds[0].people[Role.LEAD])
    assert client.get("/silent").status_code == 403
    assert undeclared_views() == ["silent"]


def test_forms_that_act_on_any_clinics_rows_are_caught(worlds, settings):
    """By a key in the address, which a page for forms alone never shows when it is opened."""

    @for_roles(Role.PT)
    @require_POST
    def rename(request: HttpRequest, patient_id: int) -> HttpResponse:
        Patient.everywhere.filter(pk=patient_id).update(end_reason="moved")
        return HttpResponse(status=404)

    @for_roles(Role.PT)
    @require_POST
    def accept(request: HttpRequest, patient_id: int) -> HttpResponse:
        return HttpResponse(status=204)

    @for_roles(Role.PT)
    @require_POST
    def move(request: HttpRequest) -> HttpResponse:
        Patient.everywhere.filter(pk=request.POST["patient"]).update(end_reason="moved")
        return HttpResponse(status=204)

    add_routes(
        settings,
        path("leaky/move", move, name="move"),
        path("leaky/<int:patient_id>/rename", rename, name="rename"),
        path("leaky/<int:patient_id>/accept", accept, name="accept"),
    )
    (actor,) = some_actors(worlds, "pt of amber")
    assert find_leaks(worlds, [actor], under="/leaky")[0] == []  # opened, they show nothing
    leaks, _ = find_foreign_writes(worlds, actor, under="/leaky")
    key = worlds[1].patient.pk
    assert f"pt of amber: /leaky/{key}/rename changes Patient of birch" in leaks
    assert f"pt of amber: /leaky/{key}/accept answers 204" in leaks
    assert "pt of amber: /leaky/move changes Patient of birch" in leaks


def test_an_address_with_an_unknown_parameter_is_caught(worlds, settings):
    add_routes(settings, path("thing/<int:thing_id>", public(lambda r: None), name="thing"))
    with pytest.raises(pytest.fail.Exception, match="thing"):
        list(all_routes(worlds))
