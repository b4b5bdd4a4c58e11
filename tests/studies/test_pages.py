"""The pages of studies: planned by clicks, seen by whom they may be, told on the record."""

from __future__ import annotations

import json
import re
from typing import Any

import pytest
from django.test import Client
from django.urls import reverse

from rehab.feedback.models import FeedbackType
from rehab.people.audit.audit_log import Act, AuditEntry
from rehab.people.models import Patient, User
from rehab.people.roles import Role
from rehab.sessions.models import TrainingSession
from rehab.sessions.setup.protocols import MeasureDefinition, Protocol
from rehab.stations.models import Station
from rehab.studies.allocation.scheme import Secret
from rehab.studies.blinding import Task, give_mark
from rehab.studies.models import Study
from rehab.studies.participants import Enrollment
from rehab.studies.registration.document import digest_of
from rehab.studies.registration.lifecycle import close
from rehab.studies.registration.sealing import seal, unseal
from tests.support.studies import SEED, draft_study, enrolled, new_patient, running_study
from tests.support.world import NOW, World, client_of, signed_in

pytestmark = pytest.mark.django_db
SIGNED = {
    "keep_data": "yes",
    "takes_part": "yes",
    "consent_version": "1.0",
    "consented_on": NOW.date().isoformat(),
}


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


def text_of(response: Any) -> str:
    return str(response.content.decode())


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


def refusals(caplog) -> list[str]:
    return [
        one.getMessage() for one in caplog.records if one.name.endswith("studies.pages.refusals")
    ]


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


# --- participants ---------------------------------------------------------------------------------


def start_visit(client: Client, enrollment: Enrollment) -> Any:
    page = client.get(reverse("participant", args=[enrollment.pk]))
    return press_start(client, enrollment, shown_visit(page))


def shown_visit(page: Any) -> str:
    found = re.search(r'name="visit" value="(\d+)"', page.content.decode())
    return found[1] if found else ""


def press_start(client: Client, enrollment: Enrollment, visit: str) -> Any:
    station = Station.everywhere.filter(clinic=enrollment.clinic).first()
    where = {"station": station.pk, "source": "live", "visit": visit, "heart_rate_limit": 130}
    return client.post(reverse("start-visit", args=[enrollment.pk]), where)


def test_a_patient_is_enrolled_and_walks_the_arm_without_it_being_named(world, caplog):
    study = running_study(world)
    patient = new_patient(world)
    pt = client_of(world)
    url = reverse("enroll", args=[study.pk])
    assert "required" in text_of(pt.post(url, {"patient": patient.pk}))
    sent = pt.post(url, SIGNED | {"patient": patient.pk})
    enrollment = Enrollment.everywhere.get(patient=patient)
    assert sent["Location"] == reverse("participant", args=[enrollment.pk])
    page = text_of(pt.get(sent["Location"]))
    assert "Start visit 1" in page
    assert "positive" not in page.lower()
    assert "negative" not in page.lower()
    session = TrainingSession.everywhere.exclude(pk=world.session.pk)
    assert start_visit(pt, enrollment).url == reverse("monitor", args=[session.get().pk])
    assert session.get().to_plan().heart_rate_limit == 130
    assert "One study a patient" in text_of(
        pt.post(url, SIGNED | {"patient": patient.pk, "keep_data": "no"})
    )
    assert refusals(caplog) == [f"Refused to account {world.people[Role.PT].pk}: {url}"]


def test_an_old_page_starts_no_visit_but_the_one_that_it_shows(world):
    study = running_study(world)
    enrollment = enrolled(study, new_patient(world))
    pt = client_of(world)
    old = shown_visit(pt.get(reverse("participant", args=[enrollment.pk])))
    assert press_start(pt, enrollment, old).status_code == 302
    assert "still has an open session" in text_of(press_start(pt, enrollment, old))
    first = TrainingSession.everywhere.filter(study_visit__enrollment=enrollment)
    first.update(state="finished")
    assert "Someone else" in text_of(press_start(pt, enrollment, old))
    assert first.count() == 1


def test_an_arm_is_revealed_with_a_reason_and_the_lead_can_read_who_asked(world):
    study = running_study(world)
    enrollment = enrolled(study, new_patient(world))
    pt, url = client_of(world), reverse("reveal", args=[enrollment.pk])
    assert pt.post(url, {"reason": ""}).status_code == 403
    shown = text_of(pt.post(url, {"reason": "dizzy", "emergency": "yes", "alone": "yes"}))
    arm = study.arms.get(code=enrollment.allocation.group)
    assert arm.name in shown
    entry = AuditEntry.everywhere.get(act=Act.UNBLIND)
    assert (entry.by, entry.patient) == (world.people[Role.PT], enrollment.patient)
    told = text_of(client_of(world, Role.LEAD).get(reverse("study", args=[study.pk])))
    assert "dizzy" in told
    assert "emergency" in told


CONDITIONS = ("positive", "negative", "feedback")


def hide_from(study: Study, world: World) -> Client:
    assessor = User.everywhere.create_user("assessor", role=Role.PT, clinic=world.clinic)
    give_mark(study, assessor, Task.ASSESSOR, None, NOW)
    return signed_in(assessor)


def test_an_assessor_reads_participants_and_visits_and_no_condition(world):
    study = running_study(world)
    assessor = hide_from(study, world)
    enrollment = enrolled(study, new_patient(world))
    start_visit(client_of(world), enrollment)
    for name, key in (("study", study.pk), ("participant", enrollment.pk)):
        page = text_of(assessor.get(reverse(name, args=[key])))
        main = page.partition("<main")[2].lower()
        assert enrollment.code.lower() in main
        assert not [word for word in CONDITIONS if word in main], name
        assert "/monitor/" not in main
    assert assessor.get(reverse("study-protocol", args=[study.pk])).status_code == 403
    refused = assessor.post(reverse("reveal", args=[enrollment.pk]), {"reason": "curious"})
    assert refused.status_code == 403
    assert "Ask a lead" in text_of(refused)
    assert study.events.filter(kind="refused").count() == 1
    assert "You assess" in text_of(start_visit(assessor, enrolled(study, new_patient(world, 2))))


def test_a_researcher_reads_codes_and_pseudonyms_alone(world):
    study = running_study(world)
    enrollment = enrolled(study, new_patient(world))
    page = text_of(client_of(world, Role.RESEARCHER).get(reverse("study", args=[study.pk])))
    assert enrollment.code in page
    assert enrollment.patient.pseudonym in page
    assert enrollment.patient.nickname not in page


def test_groups_are_told_once_the_study_is_closed(world):
    study = running_study(world)
    enrolled(study, new_patient(world))
    lead, url = client_of(world, Role.LEAD), reverse("study", args=[study.pk])
    row = rf"<td[^>]*>\s*{study.enrollments.get().allocation.group}\s*</td>"
    assert not re.search(row, text_of(lead.get(url)))
    close(study, None, NOW)
    assert re.search(row, text_of(lead.get(url)))


def test_a_draft_is_the_leads_alone(world):
    study = draft_study(world)
    assert client_of(world).get(reverse("study", args=[study.pk])).status_code == 403
    assert study.title not in text_of(client_of(world).get(reverse("studies")))


def test_marks_are_given_and_taken_by_the_lead(world):
    study = running_study(world)
    lead, url = client_of(world, Role.LEAD), reverse("study-marks", args=[study.pk])
    pt = world.people[Role.PT]
    lead.post(url, {"user": pt.pk, "task": "assessor"})
    mark = study.marks.get(user=pt)
    assert "another role" in text_of(
        lead.post(url, {"user": pt.pk, "task": "interim"}, follow=True)
    )
    lead.post(url, {"take": mark.pk})
    mark.refresh_from_db()
    assert mark.ended_at is not None


def test_leaving_by_the_page_ends_the_blinding(world):
    enrollment = enrolled(running_study(world), new_patient(world))
    client_of(world).post(reverse("leave-study", args=[enrollment.pk]), {"reason": "too far"})
    patient = Patient.everywhere.get(pk=enrollment.patient_id)
    assert not patient.blinded
    assert enrollment.events.last().reason == "too far"
