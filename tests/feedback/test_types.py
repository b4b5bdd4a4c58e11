"""What a clinic makes of a feedback type: its form, its list, its preview, and what holds then."""

from __future__ import annotations

import pytest
from django.urls import reverse

from rehab.feedback.clinic_valences import valences_of
from rehab.feedback.models import FeedbackBand, FeedbackType
from rehab.feedback.preview import preview_bands
from rehab.feedback.translation import pick_words
from rehab.people.roles import Role
from rehab.training.valences import VALENCES, CueGestures
from tests.support.forms import feedback_form
from tests.support.marks import mark
from tests.support.world import client_of

pytestmark = pytest.mark.django_db

ADD = reverse("admin:rehab_feedbacktype_add")
LIST = reverse("admin:rehab_feedbacktype_changelist")
PREVIEW = reverse("admin:rehab_feedbacktype_preview")


def test_without_a_row_the_rules_defaults_hold(world):
    FeedbackType.everywhere.filter(clinic=world.clinic).delete()
    assert valences_of(world.clinic.pk) == VALENCES


@pytest.mark.parametrize("slug", ["positive", "binary", "explicit"])
def test_a_type_taken_over_as_it_is_says_what_it_said(world, slug):
    page = client_of(world).get(f"{ADD}?slug={slug}")
    assert page.status_code == 200
    assert VALENCES[slug].bands[-1].words in page.content.decode()
    answer = client_of(world).post(f"{ADD}?slug={slug}", feedback_form(slug))
    assert answer.status_code == 302, answer.context["errors"]
    assert valences_of(world.clinic.pk)[slug] == VALENCES[slug]


def test_the_list_shows_all_four_and_which_are_edited(world):
    page = client_of(world).get(LIST).content.decode()
    for slug in set(VALENCES) - {"negative"}:
        assert f"?slug={slug}" in page
    assert page.count("edited here") == 1
    assert mark("amber", FeedbackType) in page


def test_a_researcher_looks_and_edits_nothing(world):
    row, client = world.rows[FeedbackType], client_of(world, Role.RESEARCHER)
    assert "?slug=" not in client.get(LIST).content.decode()
    url = reverse("admin:rehab_feedbacktype_change", args=[row.pk])
    assert client.get(url).status_code == 200
    assert client.post(url, feedback_form("negative")).status_code == 403
    assert client.get(PREVIEW, feedback_form("positive")).status_code == 403


def test_a_type_that_is_edited_already_is_not_added_again(world):
    row = world.rows[FeedbackType]
    answer = client_of(world).get(f"{ADD}?slug=negative")
    assert answer.headers["Location"] == reverse("admin:rehab_feedbacktype_change", args=[row.pk])
    assert client_of(world).get(f"{ADD}?slug=happy").status_code == 200  # the list


@pytest.mark.parametrize(
    ("slug", "changes", "why"),
    [
        ("positive", {"hit_points": "0"}, "pays for a hit"),
        ("positive", {"hit_points": "5000"}, "0 to 1000 points"),
        ("positive", {"bands-2-from_percent": "99"}, "begin at 1, the goal"),
        ("positive", {"bands-0-from_percent": "10"}, "begins at 0"),
        ("positive", {"bands-1-from_percent": "0"}, "from, % of the goal"),
        (
            "positive",
            {"bands-0-words_en": "Go on.\n" + "x" * 25},
            "is too long: at most 24 letters",
        ),
        ("positive", {"cue_above": "fly"}, "not one of the available choices"),
        ("binary", {"miss_points": "1"}, "0 to 1000 points"),
    ],
)
def test_what_the_rules_refuse_the_form_refuses_and_the_preview_says(world, slug, changes, why):
    client = client_of(world, Role.LEAD)
    given = feedback_form(slug, **changes)
    assert why.lower() in client.post(f"{ADD}?slug={slug}", given).content.decode().lower()
    assert not FeedbackType.everywhere.filter(slug=slug).exists()
    assert client.get(PREVIEW, given).context["errors"]


def test_explicit_has_neither_points_nor_gestures_to_edit(world):
    client = client_of(world)
    page = client.get(f"{ADD}?slug=explicit").content.decode()
    assert 'name="hit_points"' not in page
    assert 'name="cue_above"' not in page
    client.post(
        f"{ADD}?slug=explicit", feedback_form("explicit", hit_points="5", cue_above="celebrate")
    )
    mine = valences_of(world.clinic.pk)["explicit"]
    assert (mine.has_points, mine.cue) == (False, CueGestures())


def test_the_preview_shows_each_band_and_stores_nothing(world):
    given = feedback_form("positive", **{"bands-4-words_en": "Like a spring!", "hit_points": "7"})
    page = client_of(world).get(PREVIEW, given)
    assert page.headers["X-Frame-Options"] == "SAMEORIGIN"
    seen = page.context["seen"]
    assert [(one.words, one.sign, one.confetti) for one in seen][-1] == (
        "Like a spring!",
        "+7",
        "most",
    )
    assert len(seen) == 5
    assert not FeedbackType.everywhere.filter(slug="positive").exists()


def test_the_preview_of_a_band_over_the_goal_shows_both_sides():
    below, above = preview_bands(VALENCES["explicit"])
    assert (below.is_hit, above.is_hit) == (False, True)
    assert below.level < 1 / 1.5 < above.level
    assert {below.emblem, above.emblem} == {"neutral"}
    assert {below.sign, above.sign} == {""}


def test_words_fall_back_to_the_usual_ones_of_their_language(monkeypatch):
    spanish = {"Nearly there.": "Ya casi."}
    monkeypatch.setattr(
        "rehab.feedback.translation.translate",
        lambda words, language: spanish.get(words, words) if language == "es" else words,
    )
    assert pick_words("es", {"es": "Siga."}, "Nearly there.") == "Siga."
    assert pick_words("es", {"en": "Almost!"}, "Nearly there.") == "Ya casi."
    assert pick_words("es", {"en": "Almost!"}, "Go.") == "Almost!"
    assert pick_words("es", {}, "Go.") == "Go."
    assert pick_words("en", {}, "Nearly there.") == "Nearly there."


def test_bands_are_those_of_the_clinic_in_order(world):
    row = FeedbackType.everywhere.create(
        clinic=world.clinic, slug="binary", hit_points=2, miss_points=-2
    )
    for percent in (100, 0, 80):
        FeedbackBand.everywhere.create(
            feedback_type=row, from_percent=percent, words={"en": f"from {percent}"}
        )
    mine = valences_of(world.clinic.pk)["binary"]
    assert [band.words for band in mine.bands] == ["from 0", "from 80", "from 100"]
    assert (mine.points(True), mine.points(False)) == (2, -2)
