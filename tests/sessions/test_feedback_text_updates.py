"""Words that a clinic edits reach its open sessions, in each patient's language, and no other."""

from __future__ import annotations

import os
import socket

import pytest
from django.urls import reverse

from rehab.feedback.models import FeedbackType
from rehab.people.roles import Role
from rehab.sessions.live.database import clinic_owners
from rehab.sessions.live.session.aggregate import SessionAggregate
from rehab.sessions.log import SessionEvent
from tests.support.walks import make_session
from tests.support.world import build_world, set_owner

pytestmark = pytest.mark.django_db(transaction=True)


def begin(world, valence="positive", language="en"):
    world.patient.language = language
    world.patient.save()
    return make_session(world.patient, valence)


def form(slug="positive", **changes):
    """Return the form of a type with two bands."""
    return {
        "slug": slug,
        "hit_points": "3",
        "cue_above": "nod",
        "cue_below": "",
        "bands-TOTAL_FORMS": "2",
        "bands-INITIAL_FORMS": "0",
        "bands-0-from_percent": "0",
        "bands-0-words_en": "Go on.",
        "bands-0-words_es": "Siga.",
        "bands-0-confetti": "none",
        "bands-1-from_percent": "100",
        "bands-1-words_en": "There!",
        "bands-1-words_es": "",
        "bands-1-confetti": "most",
        **changes,
    }


ADD = reverse("admin:rehab_feedbacktype_add")
LIST = reverse("admin:rehab_feedbacktype_changelist")


def words_now(session, performance=1.2):
    valence = SessionAggregate.load(session).fold.valences.known["positive"]
    return valence.band(performance).phrases[0]


def test_edited_words_reach_open_sessions_and_points_do_not(world, pt):
    session, spanish = begin(world), begin(world, "negative", "es")
    ended = world.session
    before = SessionEvent.everywhere.filter(session=ended).count()
    answer = pt.post(f"{ADD}?slug=positive", form())
    assert answer.headers["Location"] == LIST
    fold = SessionAggregate.load(session).fold
    assert (fold.valence.band(0.5).words, fold.valence.band(1.2).words) == ("Go on.", "There!")
    assert (fold.valence.hit_points, fold.valence.cue.above) == (1, "varied")
    other = SessionAggregate.load(spanish).fold
    assert (
        other.valences.known["positive"].band(0.5).words == "Siga."
    )  # should it be changed to that
    event = SessionEvent.everywhere.get(session=session, kind="feedback_text")
    assert event.by == world.people[Role.PT]
    assert event.data["value"]["bands"][1]["words"] == "There!"
    assert SessionEvent.everywhere.filter(session=ended).count() == before
    new = begin(world).to_plan().valence
    assert (new.hit_points, new.cue.above, new.band(1.2).words) == (3, "nod", "There!")


def test_the_same_words_again_are_no_news(world, pt):
    session = begin(world)
    pt.post(f"{ADD}?slug=positive", form())
    row = FeedbackType.everywhere.get(slug="positive")
    changed = form(**{"hit_points": "4", "bands-INITIAL_FORMS": "2"})
    for index, band in enumerate(row.bands.order_by("from_percent")):
        changed |= {f"bands-{index}-id": band.pk, f"bands-{index}-feedback_type": row.pk}
    pt.post(reverse("admin:rehab_feedbacktype_change", args=[row.pk]), changed)
    row.refresh_from_db()
    assert row.hit_points == 4
    assert SessionEvent.everywhere.filter(session=session, kind="feedback_text").count() == 1


def test_back_to_the_defaults_brings_the_usual_words_back(world, pt):
    session = begin(world)
    pt.post(f"{ADD}?slug=positive", form())
    assert words_now(session) == "There!"
    row = FeedbackType.everywhere.get(slug="positive")
    answer = pt.post(reverse("admin:rehab_feedbacktype_delete", args=[row.pk]), {"post": "yes"})
    assert answer.status_code == 302
    assert words_now(session) == "Above goal!"


def test_another_clinic_keeps_its_words(world, pt):
    theirs = begin(build_world("birch"))
    pt.post(f"{ADD}?slug=positive", form())
    assert words_now(theirs) == "Above goal!"


def test_a_session_of_another_process_keeps_its_words_and_the_admin_says_so(world, pt):
    session = begin(world)
    other = f"{socket.gethostname()}|{os.getppid()}|{clinic_owners._start_time(os.getppid())}"
    set_owner(session.clinic_id, other)
    page = pt.post(f"{ADD}?slug=positive", form(), follow=True).content.decode()
    assert "keeps its words" in page
    assert f"run by another process ({os.getppid()})" in page
    assert FeedbackType.everywhere.filter(slug="positive").exists()
