"""The record of a trial: checklists, consents to versions, two people to reveal."""

from __future__ import annotations

import csv
import io
import re
from datetime import timedelta
from typing import Any

import pytest
from django.urls import reverse

from rehab.people.models import Patient
from rehab.people.roles import Role
from rehab.studies.agreements import StudyConsent, agree, agreed_version, agreement_rows
from rehab.studies.blinding import ASKED_FOR, Task, find_request, give_mark, reveal_arms
from rehab.studies.enrolling import withdraw_everywhere
from rehab.studies.models import Study
from rehab.studies.participants import Enrollment, StudyEvent
from rehab.studies.record.adverse_events import AdverseEvent, record
from rehab.studies.record.checklists import BY_HAND, ITEMS, checklist_rows
from rehab.studies.record.prefilled_answers import UNMASKED
from rehab.studies.record.report_statements import find
from rehab.studies.registration.estimands import estimands
from rehab.studies.registration.facts import ASKED, BEFORE
from rehab.studies.registration.lifecycle import close, register, revise
from rehab.studies.results.harms_and_deviations import OUTSIDE
from rehab.studies.results.results import read_results
from rehab.studies.visits import Place, start_session
from rehab.training.measures import InvalidSetting
from tests.support.studies import draft_study, enrolled, new_patient, running_study
from tests.support.trials import walk_visit
from tests.support.world import NOW, client_of

pytestmark = pytest.mark.django_db


def test_lists_have_every_item_of_their_statements():
    numbers = {
        name: [line.split("|")[0].strip() for line in items.strip().splitlines()]
        for name, items in ITEMS.items()
    }
    plain = {name: {int(n.rstrip("abcd")) for n in found} for name, found in numbers.items()}
    sizes = {"SPIRIT 2025": 34, "CONSORT 2025": 30, "TIDieR": 12, "WHO": 24}
    assert plain == {name: set(range(1, size + 1)) for name, size in sizes.items()}
    assert all(len(set(found)) == len(found) for found in numbers.values())


def test_what_is_known_is_filled_in_and_the_rest_is_asked(world):
    study = draft_study(world, margin=2.0, spending="pocock")
    rows = {(row["list"], row["item"]): row for row in checklist_rows(study, None)}
    assert "non-inferiority by 2" in rows["CONSORT 2025", "9"]["answer"]
    assert "6 months or more since the stroke" in rows["WHO", "14"]["answer"]
    assert "in percent of the first visit's baseline" in rows["CONSORT 2025", "14"]["answer"]
    assert rows["WHO", "19"]["answer"] in rows["SPIRIT 2025", "16"]["answer"]
    assert "pocock" in rows["SPIRIT 2025", "28b"]["answer"]
    assert rows["SPIRIT 2025", "30"]["still asked"] == str(ASKED["ethics"])
    # The sponsor's name, and what it does in the study, are two items (2013: 5b and 5c).
    assert rows["SPIRIT 2025", "3b"]["still asked"] == str(ASKED["sponsor"])
    assert str(ASKED["sponsor_role"]) in rows["SPIRIT 2025", "3c"]["still asked"]
    assert rows["CONSORT 2025", "30"]["still asked"] == BY_HAND
    asked = {slug for items in ITEMS.values() for line in items.splitlines() for slug in ASKED
             if slug in line.rpartition("|")[2].split()}  # fmt: skip
    assert asked == set(ASKED)  # nothing is asked in vain
    study.facts = dict.fromkeys(ASKED, "Zq")
    study.inclusion = "Hemiparesis after stroke"
    lacking = [row for row in checklist_rows(study, None) if row["still asked"]]
    assert {row["still asked"] for row in lacking} == {BY_HAND}
    rows = {(row["list"], row["item"]): row for row in checklist_rows(study, None)}
    assert rows["WHO", "2"]["answer"] == "See item 1."
    assert rows["SPIRIT 2025", "15b"]["answer"] == rows["SPIRIT 2025", "28a"]["answer"] == "Zq"
    assert "arms" in rows["SPIRIT 2025", "12"]["answer"]  # though the summary has said it
    texts = [row["answer"] for row in rows.values()]
    assert not [text for text in texts if "Carry-over" in text or "strata" in text]
    assert {row["list"] for row in lacking} <= {"CONSORT 2025", "TIDieR", "WHO"}


def test_a_title_says_what_is_blinded_and_who_is_simulated(world):
    study = running_study(world)
    enrolled(study, new_patient(world))

    def title():
        study.facts = {"scientific_title": "An assessor-blinded trial"}
        return next(row for row in checklist_rows(study, None) if row["list"] == "CONSORT 2025")

    assert title()["answer"] == f"An assessor-blinded trial. {UNMASKED}"
    assert "no assessor is marked" in title()["still asked"]
    Patient.everywhere.update(simulated=True)
    assert title()["answer"].startswith("Simulated: no participant was enrolled. An")
    enrolled(study, new_patient(world, 2))
    give_mark(study, world.people[Role.PT], Task.ASSESSOR, None, NOW)
    assert title()["answer"].startswith("1 of the participants are simulated. An")
    assert title()["answer"].endswith("Assessor-blinded: 1 marked.")
    assert not title()["still asked"]


def test_who_is_blinded_is_one_truth_whatever_was_typed(world):
    study = running_study(world)
    study.facts = {"blinding": "Assessors are blinded"}
    study.save(update_fields=["facts"])

    def told():
        rows = {(r["list"], r["item"]): r for r in checklist_rows(study, None)}
        return rows["SPIRIT 2025", "24a"], rows["SPIRIT 2025", "24b"]

    who, how = told()
    assert who["answer"] in (UNMASKED, "See item 1a.")
    assert "“Assessors are blinded” is not so" in who["still asked"]
    assert how["answer"] == "GARRY keeps nothing from anybody: no assessor is marked."
    give_mark(study, world.people[Role.PT], Task.ASSESSOR, None, NOW)
    who, how = told()
    assert "Assessors are blinded" in who["answer"]
    assert not who["still asked"]
    assert "kept from sessions" in how["answer"]
    study.facts = {"blinding": "Assessors are not blinded"}
    assert not told()[0]["still asked"]


def test_what_a_reviewer_would_still_ask_is_asked(world):
    study = draft_study(world, planned_sd=10.0, assumed={"difference": 5.0, "dropout": 0.1})
    study.facts = dict.fromkeys(ASKED, "Zq") | {"blinding": "Assessors, until the study is closed"}
    study.facts |= {"size": "", "everybody": ""}

    def asked():
        found = {(r["list"], r["item"]): r for r in checklist_rows(study, None)}
        items = (("SPIRIT 2025", "14a"), ("SPIRIT 2025", "19"), ("SPIRIT 2025", "24a"))
        return [found[item]["still asked"] for item in items]

    who, size, blinded = asked()
    assert who == "No criteria say who may take part"
    assert size == "20 participants are planned where the formula asks for 144"
    assert "is not so, no assessor is marked" in blinded
    study.inclusion, study.participants = "Hemiparesis after stroke", 144
    study.facts["size"] = "Zq"
    study.facts["blinding"] = "Nobody; assessors know the arm, and are not kept from it"
    assert asked() == ["", "", ""]


def test_a_closed_study_reports_flow_harms_and_who_revealed_alone(world):
    study = running_study(world)
    enrollment = enrolled(study, new_patient(world))
    reveal_arms(enrollment, "Fell", emergency=True, by=world.people[Role.LEAD], now=NOW)
    close(study, None, NOW)
    rows = list(checklist_rows(study, read_results(study, NOW)))
    consort = {row["item"]: row["answer"] for row in rows if row["list"] == "CONSORT 2025"}
    assert "1 assessed, 0 turned away (0 not eligible; 0 declined)" in consort["22a"]
    assert "1 allocated" in consort["22a"]
    assert "fall: A 0 events in 0 of 0 participants (0 visits), B" in consort["27"]
    assert "walked no visit (1 of 1) adds nothing" in consort["21b"]
    assert "B: 1 never began, 0 left later, 0 removed, 0 took" in consort["22b"]
    assert "the consent back; 2 visits missed" in consort["22b"]
    assert "Deviations: arm revealed A 0 in 0, B 1 in 1." in consort["24a"]
    assert "with 1 of 20 participants" in consort["23b"]
    assert "last enrollment 2026" in consort["23a"]
    assert "Sizes of blocks: 2, 4." in consort["17b"]
    assert consort["20b"] == "GARRY keeps nothing from anybody: no assessor is marked."
    assert "robot stop: A 0 events" in consort["27"]
    assert "1 arms revealed, 1 of them by one person alone" in consort["20a"]


def test_a_report_tells_looks_nobody_planned_events_as_judged_and_who_took_part(world):
    study = running_study(world)
    researcher = world.people[Role.RESEARCHER]
    people = [enrolled(study, new_patient(world, number)) for number in range(8)]
    Patient.everywhere.update(birth_year=1960, severity="mild")
    judged = {"grade": 3, "serious": True, "relation": "possible"}
    record(AdverseEvent(enrollment=people[0], what="fell at home", **judged), NOW)
    give_mark(study, researcher, Task.INTERIM, None, NOW)
    client_of(world, Role.RESEARCHER).get(reverse("study-results", args=[study.pk]))
    close(study, None, NOW)
    rows = list(checklist_rows(study, read_results(study, NOW)))
    consort = {row["item"]: row["answer"] for row in rows if row["list"] == "CONSORT 2025"}
    assert "None is planned. Looked at results before the end after 0/20" in consort["16b"]
    group = people[0].allocation.group
    told = f"{group} fell at home: 1 in 1 participants, highest grade 3, 1 serious, 1 related, 1 un"
    assert told in consort["27"]
    assert "A: 4 people, years of age: 4 60-69, months since the stroke" in consort["25"]
    assert "severity: 4 mild, paretic side: 4 left" in consort["25"]
    assert "a2 (" not in consort["13"]
    assert "feedback of ankle push-off power A2 (" in consort["13"]


def test_every_outcome_has_an_estimand_in_the_registered_study(world):
    study = draft_study(world, secondary_outcomes=["late_change"])
    document = register(study, None, NOW).document
    found = list(estimands(document))
    assert [one["outcome"] for one in found] == ["washout_change", "late_change"]
    parts = {"population", "treatments", "variable", "intercurrent_events", "summary"}
    assert all(parts <= one.keys() and all(one.values()) for one in found)


def test_facts_are_asked_on_a_page_and_a_later_answer_is_a_version(world):
    study, lead = draft_study(world), client_of(world, Role.LEAD)
    url = reverse("study-facts", args=[study.pk])
    assert lead.get(url).status_code == 200
    lead.post(url, {"ethics": "BASEC 2026-01234"})
    study.refresh_from_db()
    assert study.facts == {"ethics": "BASEC 2026-01234"}
    register(study, None, NOW)
    refused = lead.post(url, {"ethics": "BASEC 2026-01234", "registry": "NCT1"})
    assert refused.status_code == 200  # a reason is missing
    lead.post(url, {"ethics": "x", "registry": "NCT1", "reason": "The number came."})
    assert study.versions.last().document["facts"] == {"ethics": "x", "registry": "NCT1"}
    text = lead.get(reverse("study-checklists", args=[study.pk])).content.decode()
    rows = list(csv.DictReader(io.StringIO(text)))
    assert next(row for row in rows if row["list"] == "WHO")["answer"] == "NCT1"
    assert client_of(world, Role.PT).get(url).status_code == 403


def test_margin_and_looks_stay_as_they_were_once_the_study_runs(world):
    study = running_study(world, spending="pocock")
    for change in ({"margin": 3.0}, {"spending": "obrien_fleming"}, {"planned_sd": 4.0}):
        changed = Study.everywhere.get(pk=study.pk)
        for name, value in change.items():
            setattr(changed, name, value)
        with pytest.raises(InvalidSetting, match="stay as they were"):
            revise(changed, "A better one.", None, NOW)


def test_nobody_is_enrolled_without_a_consent_to_this_very_study(world):
    study, patient = running_study(world), new_patient(world)
    for consent in (None, StudyConsent(" ", NOW.date())):
        with pytest.raises(InvalidSetting, match="consent to this very study"):
            enrolled(study, patient, consent=consent)
    with pytest.raises(InvalidSetting, match="later than today"):
        enrolled(study, patient, consent=StudyConsent("1", NOW.date() + timedelta(days=1)))
    pt, url = client_of(world, Role.PT), reverse("enroll", args=[study.pk])
    sent = {"patient": patient.pk, "keep_data": "yes", "takes_part": "yes"}
    assert "consent to this very study" in pt.post(url, sent).content.decode()
    assert not study.enrollments.exists()
    day = NOW.date() - timedelta(days=3)
    pt.post(url, sent | {"consent_version": "1.2", "consented_on": day.isoformat()})
    one = study.enrollments.get()
    assert (one.consent_version, one.consented_on) == ("1.2", day)
    page = " ".join(pt.get(reverse("participant", args=[one.pk])).content.decode().split())
    assert f"(text 1.2; noted by {world.people[Role.PT]})" in page


def test_who_takes_the_consent_back_leaves_and_the_record_says_so(world):
    study = running_study(world)
    back, left, research = (enrolled(study, new_patient(world, n)) for n in range(3))
    pt = client_of(world, Role.PT)
    pt.post(reverse("leave-study", args=[back.pk]), {"consent": "back", "reason": "tired"})
    pt.post(reverse("leave-study", args=[left.pk]), {"reason": "moves"})
    withdraw_everywhere(research.patient, None, NOW)
    assert not study.enrollments.filter(withdrawn_at=None).exists()
    rows = list(agreement_rows(study))
    taken = [row["study_consent_withdrawn_on"] for row in rows]
    assert [one is not None for one in taken] == [True, False, True]
    close(study, None, NOW)
    told = find(study, read_results(study, NOW))["losses"]
    counts = [int(n) for n in re.findall(r"(\d+) took the consent back", told)]
    assert sum(counts) == 2
    assert rows[0]["study_consent_version"] == "1.0"
    with pytest.raises(InvalidSetting, match="has withdrawn"):
        start_session(back, Place(), None, NOW)


@pytest.mark.parametrize(("window", "expected"), [(2, [3]), (3, []), (None, [])])
def test_a_visit_outside_the_studys_window_is_a_deviation(world, window, expected):
    study = running_study(world, window_days=window)
    one = enrolled(study, new_patient(world))
    walk_visit(one)
    one.visits.filter(number=1).update(day=NOW.date() - timedelta(days=3))
    close(study, None, NOW)
    found = read_results(study, NOW).occurrences
    assert [row.value for row in found if row.what == OUTSIDE] == expected


def test_who_has_not_agreed_to_a_version_that_asks_for_it_does_not_walk(world):
    study = running_study(world)
    early = enrolled(study, new_patient(world))
    study.question = "Another question?"
    revise(study, "A blood sample.", None, NOW, needs_consent=True)
    late = enrolled(study, new_patient(world, 2))
    with pytest.raises(InvalidSetting, match="Version 2 of the study changes"):
        start_session(early, Place(), None, NOW)
    start_session(late, Place(), None, NOW)
    page = client_of(world, Role.PT)
    assert "A blood sample." in page.get(reverse("participant", args=[early.pk])).content.decode()
    page.post(reverse("agree-again", args=[early.pk]))
    assert agreed_version(early) == 2
    agree(early, None, NOW)  # nothing is left to agree to
    assert early.events.filter(kind=StudyEvent.Kind.CONSENTED).count() == 1
    study.question = "A third one?"
    revise(study, "Wording.", None, NOW)  # without asking again
    start_session(Enrollment.everywhere.get(pk=early.pk), Place(), None, NOW)
    rows = list(agreement_rows(study))
    assert [row["agreed_to_version"] for row in rows] == [2, 2]
    assert [row["enrolled_under_version"] for row in rows] == [1, 2]
    assert [row["versions_of_visits"] for row in rows] == ["1:3", "1:2"]


def test_two_people_reveal_an_arm_and_one_alone_is_recorded_as_alone(world):
    study = running_study(world)
    enrollment = enrolled(study, new_patient(world))
    lead, pt = world.people[Role.LEAD], world.people[Role.PT]
    options: dict[str, Any] = {"emergency": False, "now": NOW}
    assert reveal_arms(enrollment, "a rash", by=pt, **options) == []
    assert reveal_arms(enrollment, "still", by=pt, **options) == []  # oneself confirms nothing
    assert find_request(enrollment, NOW + ASKED_FOR + timedelta(seconds=1)) is None
    [arm] = reveal_arms(enrollment, "confirmed", by=lead, **options)
    assert arm.code == enrollment.allocation.group
    asked = client_of(world, Role.PT).get(reverse("participant", args=[enrollment.pk]))
    assert "The arm is revealed" in asked.content.decode()  # to who asked, too
    other = enrolled(study, new_patient(world, 2))
    assert reveal_arms(other, "dizzy", emergency=True, second=True, by=pt, now=NOW) == []
    assert len(reveal_arms(other, "yes", emergency=False, by=lead, now=NOW)) == 1
    third = enrolled(study, new_patient(world, 3))
    assert len(reveal_arms(third, "bleeding", emergency=True, by=pt, now=NOW)) == 1
    revealed = study.events.filter(kind__in=("unblinded", "emergency")).order_by("pk")
    assert list(revealed.values_list("kind", "about")) == [
        ("unblinded", f"asked by {pt}"),
        ("emergency", f"asked by {pt}"),
        ("emergency", "alone"),
    ]


def test_a_look_records_how_many_have_the_outcome(world):
    study = running_study(world, spending="pocock", planned_sd=1.0)
    results = read_results(study, NOW)
    assert (results.level, results.blinded_size) == (None, None)  # nobody has the outcome
    page = client_of(world, Role.RESEARCHER)
    researcher = world.people[Role.RESEARCHER]
    give_mark(study, researcher, Task.INTERIM, None, NOW)
    assert page.get(reverse("study-results", args=[study.pk])).status_code == 200
    look = study.events.get(kind=StudyEvent.Kind.LOOKED)
    assert look.about == "0/20"


def test_what_is_asked_before_a_study_is_registered_stands_on_its_page(world):
    study, lead = draft_study(world), client_of(world, Role.LEAD)
    page = reverse("register-study", args=[study.pk])
    assert "Not said yet:" in lead.get(page).content.decode()
    study.facts |= dict.fromkeys(BEFORE, "Said.")
    study.save()
    assert "Not said yet:" not in lead.get(page).content.decode()
