"""Planning a study by its pages: typed, refused at its fields, confirmed, registered, printed."""

from __future__ import annotations

import json
import re
from typing import Any

import pytest
from django.urls import reverse

from rehab.feedback.models import FeedbackType
from rehab.people.models import User
from rehab.people.roles import Role
from rehab.sessions.setup.protocol_models import MeasureDefinition, Protocol
from rehab.studies.allocation.scheme import Secret
from rehab.studies.models import Study
from rehab.studies.registration.allocation_secret import seal, unseal
from rehab.studies.registration.document import digest_of
from tests.support.studies import (
    SEED,
    draft_study,
    hide_from,
    refusals,
    running_study,
    text_of,
)
from tests.support.world import client_of

pytestmark = pytest.mark.django_db


def plan(*valences: str, **changes: Any) -> dict[str, Any]:
    """Return what the browser sends for a study of these arms."""
    protocol = Protocol.everywhere.get(clinic=None, name="Baseline, training, washout").pk
    measure = MeasureDefinition.everywhere.get(clinic=None, slug="a2").pk
    form: dict[str, Any] = {
        "code": "VAL",
        "title": "Ways to answer a step",
        "question": "Which way keeps more of the push-off?",
        "participants": 12,
        "months_since_stroke": "",
        "visits": 2,
        "days_between": 1,
        "washout_days": 7,
        "goal_percent": 100,
        "primary_outcome": "washout_change",
        "secondary_outcomes": ["hit_rate"],
        "method": "blocks",
        "block_sizes": "2, 4",
        "factors_text": "",
        "arm-TOTAL_FORMS": 4,
        "arm-INITIAL_FORMS": 0,
    }
    for number in range(4):
        used = number < len(valences)
        form |= {
            f"arm-{number}-code": "ABCD"[number] if used else "",
            f"arm-{number}-name": f"arm {number}" if used else "",
            f"arm-{number}-valence": valences[number] if used else "",
            f"arm-{number}-gain": "1,0",
            f"arm-{number}-schedule": "every",
            f"arm-{number}-schedule_steps": 1,
            f"arm-{number}-schedule_band": 10,
            f"arm-{number}-robot_intensity": "1.0",
            f"arm-{number}-measure": measure,
            f"arm-{number}-protocol": protocol if used else "",
            f"arm-{number}-weight": 1,
        }
    return form | changes


def test_a_study_is_planned_registered_started_and_closed_by_clicks(world):
    lead = client_of(world, Role.LEAD)
    assert reverse("new-study") in text_of(lead.get(reverse("studies")))
    sent = lead.post(
        reverse("new-study"), plan("positive", "negative", "explicit", block_sizes="3, 6")
    )
    study = Study.everywhere.get(code="VAL")
    page = reverse("study", args=[study.pk])
    assert sent["Location"] == page
    assert [arm.code for arm in study.arms.all()] == ["A", "B", "C"]
    assert "punishment has worked worse" in text_of(lead.get(page))
    assert lead.post(reverse("start-study", args=[study.pk]))["Location"] == page  # not before
    why = {"everybody": "A feasibility study."}
    for step, state in (("register", "registered"), ("start", "running"), ("close", "closed")):
        lead.post(reverse(f"{step}-study", args=[study.pk]), why)
        study.refresh_from_db()
        assert study.state == state
    told = json.loads(lead.get(reverse("study-protocol", args=[study.pk])).content)
    [version] = told["versions"]
    assert digest_of(version["study"]) == version["sha256"]
    secret = Secret.from_text(json.dumps(told["allocation_secret"]))
    assert secret.commitment == version["study"]["allocation"]["commitment_sha256"]


@pytest.mark.parametrize(
    ("arms", "change", "words"),
    [
        (("positive", "positive"), {}, "Arms A and B do the same"),
        (("positive",), {}, "2 to 8 arms"),
        (("positive", "negative"), {"block_sizes": "3"}, "Use multiples of 2"),
        (("positive", "negative"), {"block_sizes": "four"}, "whole numbers with commas"),
        (("positive", "negative"), {"factors_text": "severity"}, "has no levels"),
        (("positive", "negative"), {"method": "minimization"}, "name at least one"),
        (("positive", "negative"), {"method": "list"}, "Paste the list"),
        (("positive", "negative"), {"arm-0-gain": "9"}, "Give one from 0.5 to 1.5"),
        (("positive", "negative"), {"code": "val"}, "capital letters"),
    ],
)
def test_a_plan_that_cannot_be_run_is_told_how_to_mend(world, arms, change, words, caplog):
    before = Study.everywhere.count()
    answer = client_of(world, Role.LEAD).post(reverse("new-study"), plan(*arms, **change))
    assert answer.status_code == 200
    assert words in text_of(answer)
    assert Study.everywhere.count() == before
    lead = world.people[Role.LEAD]
    [logged] = refusals(caplog)
    assert logged == f"Refused to account {lead.pk}: {reverse('new-study')}"


def test_a_step_lists_what_it_fixes_and_asks_why_where_a_reviewer_would(world):
    study = draft_study(world, planned_sd=10.0, assumed={"difference": 5.0})
    lead, url = client_of(world, Role.LEAD), reverse("register-study", args=[study.pk])
    page = text_of(lead.get(url))
    for words in ("Change in washout", "Kenward", "Permuted blocks", "Nobody yet", "Goal"):
        assert words in page
    assert "20 participants are planned where the formula asks for" in page
    assert "No criteria say who may take part." in page
    assert "This field is required" in text_of(lead.post(url, {"size": "What we can reach."}))
    study.refresh_from_db()
    assert study.is_draft
    why = {"size": "What we can reach.", "everybody": "Whoever comes."}
    assert lead.post(url, why).status_code == 302
    [version] = study.versions.all()
    assert version.document["facts"] == why
    start = reverse("start-study", args=[study.pk])
    assert "Kenward" in text_of(lead.get(start))
    study.refresh_from_db()
    assert study.started_at is None  # looking is not starting
    lead.post(start)
    study.refresh_from_db()
    assert study.started_at is not None


def test_all_that_keeps_a_plan_from_being_registered_is_told_at_once_at_its_field(world):
    study = draft_study(world, visits=1, secondary_outcomes=["between_visits", "sus"])
    study.primary_outcome, study.sealed = "10mwt_follow_up", seal(Secret(SEED, (3,)))
    study.save()
    page = text_of(client_of(world, Role.LEAD).get(reverse("register-study", args=[study.pk])))
    plan_page = reverse("plan-study", args=[study.pk])
    links = re.findall(rf'href="{plan_page}#id_(\w+)"', page)
    assert links == ["block_sizes", "primary_outcome", *["secondary_outcomes"] * 2]
    lead, refused = (
        client_of(world, Role.LEAD),
        plan("positive", "negative", block_sizes="3", code="NEW"),
    )
    refused |= {"primary_outcome": "10mwt_follow_up", "secondary_outcomes": ["sus"]}
    page = text_of(lead.post(reverse("new-study"), refused))
    found = set(re.findall(r'<li><a href="#id_(\w+)"', page))
    assert found == {"primary_outcome", "block_sizes", "secondary_outcomes"}


def test_where_nobody_can_assess_it_is_said_where_to_add_one(world):
    study = draft_study(world)
    page, lead = reverse("study", args=[study.pk]), client_of(world, Role.LEAD)
    User.everywhere.filter(role=Role.PT).update(is_active=False)
    told = text_of(lead.get(page))
    assert "no further account of the clinic can be chosen" in told
    assert reverse("admin:rehab_user_add") in told


@pytest.mark.parametrize(("count", "sizes"), [(2, (4, 6)), (3, (6, 9))])
def test_blocks_fit_the_arms_unless_others_are_given(world, count, sizes):
    lead, url = client_of(world, Role.LEAD), reverse("new-study")
    lead.post(url, plan(*("positive", "negative", "explicit")[:count], block_sizes=""))
    study = Study.everywhere.get(code="VAL")
    assert unseal(study.sealed).block_sizes == sizes
    form = lead.get(reverse("plan-study", args=[study.pk])).context["form"]
    assert form["block_sizes"].value() == ""  # and its part of the page stays folded


def test_a_second_study_of_a_name_is_refused(world):
    lead, url = client_of(world, Role.LEAD), reverse("new-study")
    assert lead.post(url, plan("positive", "negative")).status_code == 302
    page = lead.post(url, plan("positive", "negative"))
    assert "already exists" in text_of(page)
    assert Study.everywhere.filter(clinic=world.clinic, code="VAL").count() == 1


def test_a_pasted_list_is_sealed_and_followed(world):
    rows = "number,Side,group\n1,left,A\n2,left,B\n1,right,B\n2,right,A\n"
    sent = plan("positive", "negative", method="list", factors_text="Side: left, right")
    client_of(world, Role.LEAD).post(reverse("new-study"), sent | {"allocation_list": rows})
    study = Study.everywhere.get(code="VAL")
    assert len(unseal(study.sealed).listed) == 4
    assert "left" not in study.sealed


def test_a_draft_keeps_its_seed_when_it_is_changed(world):
    lead = client_of(world, Role.LEAD)
    lead.post(reverse("new-study"), plan("positive", "negative"))
    study = Study.everywhere.get(code="VAL")
    url = reverse("plan-study", args=[study.pk])
    assert 'value="2, 4"' in text_of(lead.get(url))
    changed = plan("positive", "negative", title="Another title", **{"arm-INITIAL_FORMS": 2})
    for number, arm in enumerate(study.arms.all()):
        changed[f"arm-{number}-id"] = arm.pk
    assert lead.post(url, changed).status_code == 302
    seed = unseal(study.sealed).seed
    study.refresh_from_db()
    assert (study.title, unseal(study.sealed).seed) == ("Another title", seed)


def test_a_running_study_is_changed_by_a_version_with_its_reason(world):
    study = running_study(world)
    lead = client_of(world, Role.LEAD)
    url = reverse("plan-study", args=[study.pk])
    page = text_of(lead.get(url))
    assert "block_sizes" not in page
    sent = plan("positive", "negative", **{"arm-INITIAL_FORMS": 2, "arm-TOTAL_FORMS": 2})
    for number, arm in enumerate(study.arms.all()):
        sent[f"arm-{number}-id"] = arm.pk
    sent["arm-1-gain"] = "0.9"
    assert "This field is required" in text_of(lead.post(url, sent))
    assert lead.post(url, sent | {"reason": "The goal was out of reach."}).status_code == 302
    assert [v.document["arms"][1]["gain"] for v in study.versions.all()] == [1.0, 0.9]


def test_the_registered_study_is_a_pdf_with_its_seals_and_the_same_bytes_again(world):
    Protocol.everywhere.get(clinic=None, name="Baseline, training, washout").phases.filter(
        kind="training"
    ).update(goal_percent=110, robot=False, rest_s=90)
    own, _is_new = FeedbackType.everywhere.get_or_create(clinic=world.clinic, slug="negative")
    own.bands.update_or_create(from_percent=0, defaults={"words": {"en": "Push, please."}})
    study = running_study(
        world,
        factors=[["severity", ["mild", "severe"]]],
        margin=2.5,
        spending="pocock",
        facts={"ethics": "BASEC 2026-01234"},
    )
    lead, url = client_of(world, Role.LEAD), reverse("study-protocol-pdf", args=[study.pk])
    answer = lead.get(url)
    assert answer["Content-Type"] == "application/pdf"
    assert answer.content == lead.get(url).content
    told = answer.content.decode("latin-1")
    assert told.startswith("%PDF-")
    version = study.versions.get()
    assert version.digest in told
    assert study.commitment in told
    assert SEED not in told
    for words in ("negative", "severity: mild, severe", "Change in washout", "Baseline"):
        assert words in told
    lines = " ".join(re.findall(r"\((.*?)\) Tj", told))
    for words in ("goal at 110 %", "without the robot", "then a rest of 90 s", "Push, please."):
        assert words in lines
    for words in (
        "Margin of non-inferiority",
        "2.5",
        "Pocock",
        "BASEC 2026-01234",
        "Kenward",
        "strides of washout",
        "Per protocol",
        "near falls",
    ):
        assert words in lines
    page = lead.get(reverse("study", args=[study.pk])).content.decode()
    assert "Margin of non-inferiority" in page
    assert "severity: mild, severe" in page
    assert hide_from(study, world).get(url).status_code == 403
