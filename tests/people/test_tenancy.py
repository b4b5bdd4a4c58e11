"""Nobody sees another clinic's rows: every model and every route, found by themselves."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pytest
from django.contrib import admin
from django.contrib.admin.views.autocomplete import AutocompleteJsonView
from django.db.models import Q
from django.http import HttpRequest, HttpResponse
from django.urls import URLPattern, get_resolver, path, reverse

from garry_site import urls as site_urls
from rehab.boards.admin import LeaderboardAdmin
from rehab.boards.models import BoardEntry, Leaderboard
from rehab.boards.panels import rows, viewer
from rehab.boards.ranking.standings import StoredStandings
from rehab.people import api as people_api
from rehab.people.access import for_roles, public
from rehab.people.models import Patient
from rehab.people.roles import Right, Role, rights_of
from rehab.people.scope import CrossClinicReference, Scope, ScopedManager, UnscopedQuery
from rehab.people.web.admin_base import ScopedOptions
from rehab.stations.models import Device, Station
from tests.support.tenancy import all_routes, find_leaks, find_offers, may_read, walk_patterns
from tests.support.world import (
    World,
    all_actors,
    build_world,
    fill_board,
    scoped_models,
    signed_in,
)

pytestmark = pytest.mark.django_db


Worlds = Callable[[], tuple[World, World]]


def build_worlds() -> tuple[World, World]:
    both = build_world("amber"), build_world("birch")
    for world in both:
        fill_board(world)
    return both


@pytest.fixture(scope="class")
def kept_worlds(keep: Callable[..., Worlds]) -> Worlds:
    return keep(build_worlds)


@pytest.fixture
def worlds(kept_worlds: Worlds, db: None) -> tuple[World, World]:
    return kept_worlds()


# --- models -------------------------------------------------------------------------------------


def test_every_model_says_how_it_belongs_to_a_clinic(worlds):
    for model in scoped_models():
        assert isinstance(getattr(model, "scope", None), Scope), f"{model} has no scope"
        assert isinstance(model.objects, ScopedManager), f"{model}.objects is not scoped"
        for world in worlds:
            assert model in world.rows, f"tests/support/world.py makes no {model.__name__}"


@pytest.mark.parametrize("model", scoped_models(), ids=lambda model: model.__name__)
def test_objects_gives_nothing_before_it_is_told_for_whom(model):
    objects = model.objects
    for query in (objects.all, objects.filter, objects.count, objects.create, objects.first):
        with pytest.raises(UnscopedQuery, match="visible_to"):
            query()


def test_every_actor_sees_rows_of_the_own_clinic_only(worlds):
    for actor in all_actors(*worlds):
        for model in scoped_models():
            seen = set(model.objects.visible_to(actor.subject).values_list("pk", flat=True))
            for world in worlds:
                row = world.rows[model]
                if actor.role == "device":
                    station_side = {
                        "Station",
                        "TrainingSession",
                        "Step",
                        "SessionEvent",
                        "SessionMetric",
                    }
                    expected = actor.clinic == world.name and model.__name__ in station_side
                else:
                    expected = may_read(actor, model, world.name) and Right.VIEW in rights_of(
                        actor.role, model.__name__
                    )
                assert (row.pk in seen) == expected, (
                    f"{actor.label}, {model.__name__}, {world.name}"
                )


@pytest.mark.parametrize("nobody", [None, object(), "pt", 1])
def test_what_is_no_actor_sees_nothing(nobody, worlds):
    assert not any(model.objects.visible_to(nobody).exists() for model in scoped_models())


def test_a_device_sees_its_own_station_only_and_nothing_once_revoked(worlds):
    amber, _ = worlds
    other = Station.everywhere.create(clinic=amber.clinic, name="other")
    neighbor = Device(clinic=amber.clinic, station=other, kind="tablet", name="n", token_hash="n")
    neighbor.save()
    assert not type(amber.session).objects.visible_to(neighbor).exists()
    assert type(amber.session).objects.visible_to(amber.device).exists()
    amber.device.revoked_at = amber.device.created_at
    assert not type(amber.session).objects.visible_to(amber.device).exists()


def test_rows_of_two_clinics_are_never_tied_together(worlds):
    amber, birch = worlds
    stray = Device(
        clinic=amber.clinic, station=birch.rows[Station], kind="robot", name="x", token_hash="x"
    )
    with pytest.raises(CrossClinicReference, match="same clinic"):
        stray.save()
    amber.session.patient = birch.patient
    with pytest.raises(CrossClinicReference):
        amber.session.save()


# --- routes -------------------------------------------------------------------------------------


def test_no_route_shows_a_clinic_to_others(worlds, capsys):
    actors = all_actors(*worlds)
    leaks, counts = find_leaks(worlds, actors)
    assert leaks == []
    routes = {name for name, _, _ in walk_patterns(get_resolver())}
    assert min(counts.values()) > 100  # the matrix is not empty
    with capsys.disabled():
        print(f"\ntenancy: {len(routes)} routes × {len(actors)} actors, {counts.total()} requests")


def test_every_view_says_who_may_open_it():
    for name, _, pattern in walk_patterns(get_resolver()):
        if not name.startswith("admin:"):
            assert isinstance(getattr(pattern.callback, "access", None), frozenset), name


def test_every_admin_page_is_scoped():
    for model, options in admin.site._registry.items():
        assert isinstance(options, ScopedOptions), model
        for inline in options.inlines:
            assert issubclass(inline, ScopedOptions), inline


def test_every_form_offers_rows_of_the_own_clinic_only(worlds):
    leaks, checked = find_offers(worlds, all_actors(*worlds))
    assert leaks == []
    assert checked


# --- the matrix can fail: seeded leaks ------------------------------------------------------------


@dataclass(frozen=True)
class NoScope(Scope):
    """A scope that somebody forgot: rights hold, clinics do not."""

    def clinic_filter(self, clinic_id: int) -> Q:
        return Q()


# Models that have pages, and where at least the matrix must find them shown to another clinic.
SHOWN_UNDER = {
    "/admin/": {"Patient", "Station", "Device", "Measure", "Protocol", "Gesture", "Leaderboard"}
    | {"TrainingSession", "ProtocolPhase", "User", "ApiToken"},
    "/api/v1/": {"Patient", "Station", "Protocol", "Leaderboard"},
    "/admin/autocomplete/": {"Patient", "User"},
    "/patients": {"Patient"},
    "/sessions": {"Patient"},
}


def test_a_forgotten_scope_is_caught_wherever_it_shows(worlds, monkeypatch):
    """Every model without its scope at once: the matrix says so of admin, API and pages."""
    for model in scoped_models():
        old = model.scope
        monkeypatch.setattr(model, "scope", NoScope(old.clinic, old.station, old.shared, old.host))
    eyes = [one for one in all_actors(*worlds) if one.label in ("lead of birch", "pt of birch")]
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


def test_a_picker_of_every_row_is_caught(worlds, monkeypatch):
    def offer_all(self: Any, db: Any, db_field: Any, request: HttpRequest) -> Any:
        return db_field.remote_field.model.everywhere.all()

    monkeypatch.setattr(ScopedOptions, "get_field_queryset", offer_all)
    actors = all_actors(*worlds)
    assert (
        "pt of amber: Leaderboard.group offers Patient of birch" in find_offers(worlds, actors)[0]
    )
    leaks, _ = find_leaks(worlds, actors, under="/admin/rehab/leaderboard/add/")
    assert "pt of amber: /admin/rehab/leaderboard/add/ shows Patient of birch" in leaks


def test_a_chooser_of_whose_eyes_a_board_is_seen_with_is_caught(worlds, monkeypatch):
    everybody = Patient.everywhere.annotate(alone=Q(boards="own")).order_by("pk")
    monkeypatch.setattr(LeaderboardAdmin, "_patients_who_walked", lambda self, request: everybody)
    leaks, _ = find_leaks(worlds, all_actors(*worlds), under="/admin/rehab/leaderboard/")
    assert "pt of amber: /admin/rehab/leaderboard/add/ shows Patient of birch" in leaks


def test_an_autocomplete_of_every_row_is_caught(worlds, monkeypatch):
    monkeypatch.setattr(
        AutocompleteJsonView, "get_queryset", lambda self: Patient.everywhere.order_by("pk")
    )
    leaks, _ = find_leaks(worlds, all_actors(*worlds), under="/admin/autocomplete/")
    assert any(
        leak.startswith("pt of birch: ") and leak.endswith("shows Patient of amber")
        for leak in leaks
    )


def test_an_unscoped_admin_queryset_is_caught(worlds, monkeypatch):
    monkeypatch.setattr(
        ScopedOptions, "get_queryset", lambda self, request: self.model.everywhere.all()
    )
    leaks, _ = find_leaks(worlds, all_actors(*worlds), under="/admin/rehab/patient/")
    assert "pt of birch: /admin/rehab/patient/ shows Patient of amber" in leaks


def test_an_unscoped_page_is_caught(worlds, settings, monkeypatch):
    @for_roles(Role.PT)
    def leaky(request: HttpRequest) -> HttpResponse:
        return HttpResponse(", ".join(str(patient) for patient in Patient.everywhere.all()))

    with_patterns(settings, monkeypatch, path("leaky", leaky, name="leaky"))
    leaks, _ = find_leaks(worlds, all_actors(*worlds), under="/leaky")
    assert "pt of amber: /leaky shows Patient of birch" in leaks
    assert not any("researcher" in leak for leak in leaks)  # the role table held


def test_a_public_page_with_patients_is_caught(worlds, settings, monkeypatch):
    @public
    def leaky(request: HttpRequest) -> HttpResponse:
        return HttpResponse(str(Patient.everywhere.first()))

    with_patterns(settings, monkeypatch, path("leaky", leaky, name="leaky"))
    leaks, _ = find_leaks(worlds, all_actors(*worlds), under="/leaky")
    assert "stranger: /leaky shows Patient of amber" in leaks


def test_rows_of_another_clinics_board_are_caught(worlds, monkeypatch):
    monkeypatch.setattr(StoredStandings, "find_rows", lambda self: BoardEntry.everywhere.all())
    monkeypatch.setattr(rows, "eligible_patients", lambda board: Patient.everywhere.all())
    leaks, _ = find_leaks(worlds, all_actors(*worlds), under="/sessions/")
    url = reverse("scores", kwargs={"session_id": worlds[0].session.pk})
    assert f"pt of amber: {url} shows Patient of birch" in leaks


def test_a_board_of_another_clinic_is_caught(worlds, monkeypatch):
    monkeypatch.setattr(
        viewer, "boards_on", lambda occasion, clinic: list(Leaderboard.everywhere.all())
    )
    leaks, _ = find_leaks(worlds, all_actors(*worlds), under="/sessions/")
    url = reverse("scores", kwargs={"session_id": worlds[0].session.pk})
    assert f"pt of amber: {url} shows Leaderboard of birch" in leaks


def test_unscoped_calls_of_the_api_are_caught(worlds, monkeypatch):
    monkeypatch.setattr(people_api, "patients_of", lambda user: Patient.everywhere.order_by("pk"))
    leaks, _ = find_leaks(worlds, all_actors(*worlds), under="/api/v1/")
    key = worlds[0].patient.pk
    assert "pt of birch: /api/v1/patients shows Patient of amber" in leaks
    assert f"pt of birch: /api/v1/patients/{key} shows Patient of amber" in leaks
    assert not any("researcher" in leak for leak in leaks)  # the role table held


def test_a_name_that_the_api_tells_researchers_is_caught(worlds, monkeypatch):
    monkeypatch.setattr(people_api, "may_see_names", lambda context: True)
    leaks, _ = find_leaks(worlds, all_actors(*worlds), under="/api/v1/")
    assert "researcher of amber: /api/v1/sessions shows Patient of amber" in leaks


def test_a_page_that_declares_nothing_is_closed_and_caught(worlds, settings, monkeypatch):
    def silent(request: HttpRequest) -> HttpResponse:
        return HttpResponse("open")

    with_patterns(settings, monkeypatch, path("silent", silent, name="silent"))
    client = signed_in(worlds[0].people[Role.LEAD])
    assert client.get("/silent").status_code == 403
    with pytest.raises(AssertionError, match="silent"):
        test_every_view_says_who_may_open_it()


def test_an_address_with_an_unknown_parameter_is_caught(worlds, settings, monkeypatch):
    with_patterns(
        settings, monkeypatch, path("thing/<int:thing_id>", public(lambda r: None), name="thing")
    )
    with pytest.raises(pytest.fail.Exception, match="thing"):
        list(all_routes(worlds))


def with_patterns(settings: Any, monkeypatch: pytest.MonkeyPatch, *extra: URLPattern) -> None:
    """Add addresses to the site for one test."""
    import sys
    import types

    module = types.ModuleType("seeded_urls")
    module.urlpatterns = [*extra, *site_urls.urlpatterns]  # type: ignore[attr-defined]
    monkeypatch.setitem(sys.modules, "seeded_urls", module)
    settings.ROOT_URLCONF = "seeded_urls"


def test_pages_and_admin_never_ask_for_rows_of_everywhere():
    """`everywhere` is for the server's own work; code that answers people goes by `visible_to`."""
    root = Path(site_urls.__file__).resolve().parent.parent / "rehab"
    named = ("*admin*", "api*", "schemas", "consumers/*", "forms")
    answering = [file for name in named for file in root.rglob(f"{name}.py")]
    answering += root.rglob("views/*.py")
    assert len(answering) > 10
    for file in answering:
        assert "everywhere" not in file.read_text(), file
