"""The numbers of docs/capacity.md follow from what was measured, and its keys from the models."""

from __future__ import annotations

import importlib.util
import sys
from dataclasses import replace
from types import ModuleType

import pytest
from django.apps import apps
from django.db.models import UniqueConstraint

from rehab.people.models import Clinic
from tests.support.servers import ROOT

PAGE = (ROOT / "docs" / "capacity.md").read_text("utf-8")


@pytest.fixture(scope="module")
def capacity() -> ModuleType:
    """`deploy/capacity.py`, which is no package's."""
    spec = importlib.util.spec_from_file_location("capacity", ROOT / "deploy" / "capacity.py")
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules["capacity"] = module
    spec.loader.exec_module(module)
    return module


def test_the_page_has_what_is_computed(capacity):
    for table in capacity.write_tables(capacity.read_measured()).split("\n\n"):
        assert table.strip() in PAGE


def test_a_figure_that_is_gone_is_named(capacity):
    with pytest.raises(ValueError, match="no figure like"):
        capacity.Measured.read("", "")


def test_what_costs_more_breaks_sooner(capacity):
    measured = capacity.read_measured()
    heavier = replace(
        measured,
        planned_sessions=measured.planned_sessions / 2,
        row_us=2 * measured.row_us,
        row_bytes=2 * measured.row_bytes,
        index_bytes=2 * measured.index_bytes,
    )
    for limit in capacity.LIMITS:
        light, heavy = (capacity.breaks_at(limit, one) for one in (measured, heavier))
        if light is not None and "connections" not in limit[0]:
            assert heavy < light, limit[0]
            assert heavy == pytest.approx(light / 2, rel=0.5)


def test_a_limit_is_passed_where_it_is_said(capacity):
    measured, assumed = capacity.read_measured(), capacity.Assumed()
    for limit in capacity.LIMITS:
        at = capacity.breaks_at(limit, measured)
        if at is not None:
            shares = [limit[2](capacity.need(n, measured), measured, assumed) for n in (at - 1, at)]
            assert shares[0] <= 1 < shares[1]


def test_needs_by_hand(capacity):
    """A hundred clinics: ten sessions of 1800 s in a day of 28,800 s, twice the mean."""
    found = capacity.need(100, capacity.read_measured())
    assert found.sessions == pytest.approx(2 * 100 * 10 * 1800 / 28_800)
    assert found.rows_month == pytest.approx(100 * 10 * 21 * 1800 / 1.05)
    assert found.online_gb == pytest.approx(found.rows_month * 12 * (264 + 54) * 2 / 1e9, rel=0.01)


def all_models():
    return [*apps.get_app_config("rehab").get_models()]


def without_clinic() -> list[str]:
    """Return the models whose tables have no column of the clinic."""
    return sorted(
        model.__name__
        for model in all_models()
        if model is not Clinic
        and "clinic" not in {field.name for field in model._meta.concrete_fields}
    )


def unique_everywhere() -> list[str]:
    """Return what is unique in a whole database and not by a clinic's own row."""
    found = []
    for model in all_models():
        fields = [f for f in model._meta.concrete_fields if f.unique and not f.primary_key]
        found += [f"`{model.__name__}.{f.name}`" for f in fields if not f.is_relation]
        for one in model._meta.constraints:
            if isinstance(one, UniqueConstraint) and not any(
                model._meta.get_field(name).is_relation for name in one.fields
            ):
                found.append(f"`{model.__name__}` ({', '.join(one.fields)})")
    return sorted(found)


def test_the_page_names_the_keys_that_do_not_fit():
    assert ", ".join(f"`{name}`" for name in without_clinic()) in " ".join(PAGE.split())
    assert ", ".join(unique_everywhere()) in " ".join(PAGE.split())
