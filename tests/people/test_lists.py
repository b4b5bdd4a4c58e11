"""A list of the admin is narrowed by its own filters and our own links, and by nothing else."""

from __future__ import annotations

import html
import re
from urllib.parse import parse_qsl, urljoin, urlsplit

import pytest
from django.contrib import admin
from django.test import Client
from django.urls import reverse
from django.utils.text import capfirst

from rehab.people.roles import Role
from rehab.sessions.admin.presets import PresetAdmin
from rehab.sessions.models import TrainingSession
from tests.support.extent import EVERYTHING
from tests.support.world import client_of, scoped_models

pytestmark = pytest.mark.django_db

LOOKUPS = ("icontains", "isnull")
REGISTERED = [model for model in scoped_models() if admin.site.is_registered(model)]
SESSIONS = "admin:rehab_trainingsession_changelist"


def list_of(model: type) -> str:
    return reverse(f"admin:rehab_{model.__name__.lower()}_changelist")


def is_refused(client: Client, where: str, /, **asked: str) -> bool:
    answer = client.get(where, asked)
    return answer.status_code == 400 or answer.headers.get("Location", "").endswith("?e=1")


@pytest.mark.wide
def test_a_list_is_called_what_it_lists(world):
    client, titled = world.lead, 0
    for model in REGISTERED:
        page = client.get(list_of(model))
        if page.status_code == 200 and "cl" in page.context:
            assert page.context["title"] == capfirst(model._meta.verbose_name_plural)
            titled += 1
    assert titled > 10


def test_a_researcher_cannot_ask_letter_by_letter_what_is_hidden(world):
    TrainingSession.everywhere.filter(pk=world.session.pk).update(
        source="Recording: maria_lopez.csv", legacy_row={"participant_id": 7}
    )
    client, url = client_of(world, Role.RESEARCHER), reverse(SESSIONS)
    assert client.get(url).context["cl"].result_count == 1
    for digit in ("7", "8"):
        assert is_refused(client, url, original__participant_id__icontains=digit)
        assert is_refused(client, url, original__icontains=digit)
    assert is_refused(client, url, source__icontains="maria")
    assert is_refused(client, url, metric_score__gt="0")  # of what the list adds by itself


@pytest.mark.wide
@pytest.mark.parametrize("model", REGISTERED, ids=lambda model: model.__name__)
def test_a_list_is_not_narrowed_by_fields_that_it_has_no_filter_for(world, model):
    client, url = world.lead, list_of(model)
    if "cl" not in client.get(url).context:
        return  # a page of its own, which always shows all
    pages = admin.site.get_model_admin(model)
    offered = {one[0] if isinstance(one, tuple) else one for one in pages.list_filter}
    asked = [f"{field.name}__{lookup}" for field in model._meta.fields for lookup in LOOKUPS]
    asked += [f.name for f in model._meta.fields if f.name not in offered] + ["pk", "pk__in"]
    for name in asked:
        field, _, lookup = name.rpartition("__")
        if lookup == "isnull" and field in offered:
            continue  # "empty", where a filter has it
        assert is_refused(client, url, **{name: "1"}), name


def test_the_check_above_finds_a_list_that_takes_any_field(world, monkeypatch):
    monkeypatch.setattr(PresetAdmin, "get_changelist", admin.ModelAdmin.get_changelist)
    url = reverse("admin:rehab_preset_changelist")
    assert not is_refused(world.lead, url, name__icontains="1")


@pytest.mark.wide
@pytest.mark.parametrize(
    "role",
    [
        Role.RESEARCHER,
        *(pytest.param(role, marks=pytest.mark.long) for role in (Role.LEAD, Role.PT)),
    ],
)
def test_every_link_on_a_list_and_on_a_rows_page_leads_somewhere(world, role):
    """Filters, columns, and what a session's page says of its log."""
    client = client_of(world, role)
    lists = [url for model in REGISTERED if client.get(url := list_of(model)).status_code == 200]
    session = reverse("admin:rehab_trainingsession_change", args=[world.session.pk])
    followed, kinds = set(), set()
    for url in (*lists, session):
        page = client.get(url).content.decode()
        for link in re.findall(r'href="([^"]*\?[^"]*)"', page):
            there = urljoin(url, html.unescape(link))
            to, asked = urlsplit(there).path, urlsplit(there).query
            kind = there if EVERYTHING else (to, *sorted(dict(parse_qsl(asked))))
            if to in lists and kind not in kinds:
                followed.add(there)
                kinds.add(kind)
                assert client.get(there).status_code == 200, (url, there)
    names = {name for there in followed for name in re.findall(r"[?&](\w+)=", there)}
    assert {"session__id__exact", "valence__exact", "state__exact", "weeks", "also", "o"} <= names


@pytest.mark.parametrize(
    "asked",
    [
        {"created_at__year": "9999"},
        {"created_at__year": "9999", "created_at__month": "12"},
        {"created_at__year": "0"},
        {"created_at__year": "many"},
        {"created_at__month": "3"},
    ],
)
def test_a_day_of_no_calendar_is_refused(world, asked):
    assert is_refused(world.pt, reverse(SESSIONS), **asked)
