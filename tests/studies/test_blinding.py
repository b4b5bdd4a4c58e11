"""Who must not know an arm learns it nowhere; who may, does it on the record."""

from __future__ import annotations

from datetime import timedelta

import pytest
from django.test import Client
from django.urls import get_resolver, reverse

from rehab.boards.models import Leaderboard
from rehab.boards.ranking.eligibility import eligible_patients
from rehab.patients.erasure import erase
from rehab.patients.family import find_link, give_link
from rehab.patients.visits import Visit
from rehab.people.consent.models import Purpose
from rehab.people.consent.services import record_consent, withdraw_consent
from rehab.people.models import ErasureReason, Patient, User
from rehab.people.roles import Role
from rehab.sessions.live.session.aggregate import SessionAggregate
from rehab.sessions.log import SessionEvent, Step
from rehab.sessions.models import TrainingSession
from rehab.sessions.services import SessionRequest, create_session
from rehab.studies.blinding import Task, UnblindingRefused, give_mark, reveal_arms, take_mark
from rehab.studies.enrolling import enroll, withdraw
from rehab.studies.participants import Allocation, Enrollment, StudyEvent, StudyVisit
from rehab.studies.registration.lifecycle import close
from rehab.studies.visits import Place, next_visit, start_session
from rehab.training.changes import Change, ChangeKind
from rehab.training.goals import GoalRule
from rehab.training.measures import InvalidSetting
from tests.support.archives import words_of
from tests.support.studies import CONSENT, enrolled, new_patient, running_study
from tests.support.tenancy import walk_patterns
from tests.support.world import NOW, World, build_world, signed_in

pytestmark = pytest.mark.django_db


def new_pt(world: World, name: str = "assessor") -> User:
    return User.everywhere.create_user(name, role=Role.PT, clinic=world.clinic)


def walked(enrollment: Enrollment, by: User | None = None) -> TrainingSession:
    session = start_session(enrollment, Place(), by, NOW)
    session.state, session.started_at, session.ended_at = "finished", NOW, NOW
    session.active_s = 60
    session.save()
    return session


# --- who assesses ---------------------------------------------------------------------------------


@pytest.mark.parametrize("role", [Role.LEAD, Role.RESEARCHER])
def test_an_assessor_becomes_no_lead(world, role):
    """A lead could give herself a robot's token, which is told the feedback type."""
    assessor = new_pt(world)
    give_mark(running_study(world), assessor, Task.ASSESSOR, None, NOW)
    url = reverse("admin:rehab_user_change", args=[assessor.pk])
    answer = world.lead.post(url, {"username": "assessor", "role": role, "is_active": "on"})
    assessor.refresh_from_db()
    assert ("end the mark" in words_of(answer)) == (role == Role.LEAD)
    assert assessor.role == (Role.PT if role == Role.LEAD else role)


# --- enrollment -----------------------------------------------------------------------------------


def test_enrolling_allocates_blinds_and_plans_the_visits(world):
    study = running_study(world)
    patient = new_patient(world)
    enrollment = enrolled(study, patient)
    patient.refresh_from_db()
    assert patient.blinded
    assert enrollment.code == "VAL-001"
    assert enrollment.allocation.group in {"A", "B"}
    days = list(enrollment.visits.values_list("day", flat=True))
    assert days == list(Visit.everywhere.filter(patient=patient).values_list("day", flat=True))
    assert days[1] - days[0] == timedelta(days=1)


@pytest.mark.wide
def test_allocation_follows_the_sealed_seed_in_blocks(world):
    def run(seed_of: World) -> list[str]:
        study = running_study(seed_of)
        return [
            enrolled(study, new_patient(seed_of, number)).allocation.group for number in range(8)
        ]

    groups = run(world)
    assert abs(groups.count("A") - groups.count("B")) <= 2
    assert groups == run(build_world("other"))  # the same seed


@pytest.mark.parametrize("case", ["consent", "ended", "twice", "open session", "full", "level"])
def test_who_cannot_take_part_is_not_enrolled_and_nothing_is_stored(world, case):
    study = running_study(world, participants=2)
    patient = new_patient(world, consents=case != "consent")
    levels: tuple[str, ...] = ()
    match case:
        case "ended":
            Patient.everywhere.filter(pk=patient.pk).update(ended_at=NOW)
        case "twice":
            withdraw(enrolled(study, patient), None, NOW)
        case "open session":
            protocol = study.arms.first().protocol
            goal = GoalRule(value=1.0)
            create_session(
                SessionRequest(patient=patient, valence="positive", goal=goal, protocol=protocol)
            )
        case "full":
            for number in (2, 3):
                enrolled(study, new_patient(world, number))
        case "level":
            levels = ("mild",)
    words = {
        "consent": "not consented to research",
        "ended": "program has ended",
        "twice": "One study a patient",
        "open session": "End it first",
        "full": "all its 2 participants",
        "level": "one level of each factor",
    }
    before = Enrollment.everywhere.count()
    with pytest.raises(InvalidSetting, match=words[case]):
        enroll(study, patient, levels, keep_data=True, by=None, now=NOW, consent=CONSENT)
    assert Enrollment.everywhere.count() == before == Allocation.everywhere.count()


# --- sessions -------------------------------------------------------------------------------------


def test_a_session_of_the_study_is_the_arms(world):
    study = running_study(world)
    study.arms.filter(code="A").update(gain=0.85, robot_intensity=0.0)
    from rehab.studies.registration.lifecycle import revise

    revise(study, "hidden gain", None, NOW)
    by_arm = {}
    for number in range(4):
        enrollment = enrolled(study, new_patient(world, number))
        by_arm[enrollment.allocation.group] = start_session(enrollment, Place(), None, NOW)
    first, second = by_arm["A"].plan, by_arm["B"].plan
    assert (by_arm["A"].valence, by_arm["B"].valence) == ("positive", "negative")
    assert [phase["gain"] for phase in first["phases"]] == [1.0, 0.85, 1.0]
    assert [phase["gain"] for phase in second["phases"]] == [1.0, 1.0, 1.0]
    assert (first["robot_intensity"], second["robot_intensity"]) == (0.0, 1.0)
    assert first["goal"] == {
        "value": None,
        "percent_of_baseline": 100,
        "asks": False,
        "baseline_strides": 50,
    }


@pytest.mark.parametrize("kind", [ChangeKind.VALENCE, ChangeKind.VALENCE_NOW])
def test_a_sessions_type_stays_that_of_its_arm(world, kind):
    study = running_study(world, "positive", "negative")
    session = start_session(enrolled(study, new_patient(world)), Place(), None, NOW)
    other = "negative" if session.valence == "positive" else "positive"
    with pytest.raises(InvalidSetting, match="belongs to a study"):
        SessionAggregate(session).change(Change(kind, other), None, NOW)


def test_each_visit_is_walked_once_and_again_after_a_session_that_was_broken_off(world):
    enrollment = enrolled(running_study(world), new_patient(world))
    broken = start_session(enrollment, Place(), None, NOW)
    broken.state = "aborted"
    broken.save()
    assert next_visit(enrollment).number == 1
    again = walked(enrollment)
    assert again.study_visit.attempt == 2
    assert walked(enrollment).study_visit.number == 2
    assert next_visit(enrollment) is None
    with pytest.raises(InvalidSetting, match="all visits"):
        start_session(enrollment, Place(), None, NOW)


def test_no_visit_starts_while_the_one_before_is_open(world):
    """Two people start the same visit: the second one must not begin the other arm."""
    study = running_study(world, crossover=True, visits=1)
    enrollment = enrolled(study, new_patient(world))
    url = reverse("participant", args=[enrollment.pk])
    therapist = signed_in(world.people[Role.PT])
    assert b"Start visit 1" in therapist.get(url).content
    start_session(enrollment, Place(), None, NOW)
    assert b"Start visit" not in therapist.get(url).content
    with pytest.raises(InvalidSetting, match="still open"):
        start_session(enrollment, Place(), None, NOW)
    assert enrollment.visits.exclude(session=None).count() == 1


def test_a_crossover_walks_the_arms_in_the_allocated_order(world):
    study = running_study(world, crossover=True, visits=1)
    enrollment = enrolled(study, new_patient(world))
    order = enrollment.allocation.group.split("-")
    valences = {"A": "positive", "B": "negative"}
    assert [walked(enrollment).valence for _ in order] == [valences[code] for code in order]
    days = list(enrollment.visits.values_list("day", flat=True))
    assert days[1] - days[0] == timedelta(days=7)


# --- what is hidden -------------------------------------------------------------------------------


def test_an_assessor_sees_no_session_of_the_study_and_all_others(world):
    study = running_study(world)
    assessor = new_pt(world)
    give_mark(study, assessor, Task.ASSESSOR, None, NOW)
    patient = new_patient(world)
    enrollment = enrolled(study, patient)
    session = walked(enrollment)
    seen = TrainingSession.objects.visible_to(assessor)
    assert list(seen) == [world.session]
    colleague = new_pt(world, "colleague")
    assert session in TrainingSession.objects.visible_to(colleague)
    for rows in (Step, SessionEvent):
        hidden = rows.objects.visible_to(assessor).filter(session=session)
        assert not hidden.exists()
    assert not Allocation.objects.visible_to(assessor).filter(enrollment=enrollment).exists()
    assert not StudyEvent.objects.visible_to(assessor).filter(enrollment=enrollment).exists()
    assert Enrollment.objects.visible_to(assessor).filter(pk=enrollment.pk).exists()
    assert StudyVisit.objects.visible_to(assessor).filter(enrollment=enrollment).exists()
    withdraw(enrollment, None, NOW)
    assert list(seen.all()) == [world.session]  # what was walked stays hidden
    close(study, None, NOW)
    assert session in TrainingSession.objects.visible_to(assessor)


@pytest.mark.wide
def test_an_assessor_is_refused_by_every_page_call_and_export_of_a_session(world):
    study = running_study(world)
    assessor, colleague = new_pt(world), new_pt(world, "colleague")
    give_mark(study, assessor, Task.ASSESSOR, None, NOW)
    session = start_session(enrolled(study, new_patient(world)), Place(), None, NOW)
    names = ("walk", "monitor", "session", "report")
    urls = [reverse(name, kwargs={"session_id": session.pk}) for name in names]
    urls.append(reverse("api:show_session", kwargs={"session_id": session.pk}))
    for url in urls:
        assert signed_in(colleague).get(url).status_code == 200, url
        assert signed_in(assessor).get(url).status_code == 404, url
    listed = signed_in(assessor).get(reverse("api:list_sessions")).json()
    assert session.pk not in [row["id"] for row in listed.get("items", listed)]


def ask(client: Client, url: str) -> int:
    """Return the answer's status, also where only changes are taken."""
    status = int(client.get(url).status_code)
    if status == 405:
        answer = client.post(url, {"kind": "pause"}, content_type="application/json")
        status = int(answer.status_code)
    return status


@pytest.mark.parametrize("ended", [False, True])
def test_no_address_of_a_session_answers_an_assessor_whatever_it_is_for(world, ended):
    study = running_study(world)
    give_mark(study, new_pt(world), Task.ASSESSOR, None, NOW)
    assessor, colleague = (
        signed_in(person) for person in (study.marks.get().user, new_pt(world, "colleague"))
    )
    enrollment = enrolled(study, new_patient(world))
    session = walked(enrollment) if ended else start_session(enrollment, Place(), None, NOW)
    addresses = [
        reverse(name, kwargs={"session_id": session.pk})
        for name, _route, pattern in walk_patterns(get_resolver())
        if set(pattern.pattern.converters) == {"session_id"}
    ]
    assert len(addresses) > 15
    answers = {url: ask(assessor, url) for url in addresses}
    assert {url: status for url, status in answers.items() if status != 404} == {}
    assert any(colleague.get(url).status_code == 200 for url in addresses)


def test_an_assessor_cannot_set_up_a_session_and_so_learn_of_it(world):
    study = running_study(world)
    assessor = new_pt(world)
    give_mark(study, assessor, Task.ASSESSOR, None, NOW)
    patient = new_patient(world)
    enrollment = enrolled(study, patient)
    with pytest.raises(InvalidSetting, match="Ask a colleague who treats"):
        start_session(enrollment, Place(), assessor, NOW)
    assert next_visit(enrollment).session is None


def test_a_researcher_sees_no_session_before_the_end_also_with_the_mark(world):
    study = running_study(world)
    enrollment = enrolled(study, new_patient(world))
    session = walked(enrollment)
    researcher = world.people[Role.RESEARCHER]
    assert session not in TrainingSession.objects.visible_to(researcher)
    assert not Allocation.objects.visible_to(researcher).filter(enrollment=enrollment).exists()
    give_mark(study, researcher, Task.INTERIM, None, NOW)
    assert session not in TrainingSession.objects.visible_to(researcher)
    assert not Allocation.objects.visible_to(researcher).filter(enrollment=enrollment).exists()
    take_mark(study.marks.get(user=researcher), None, NOW)
    assert session not in TrainingSession.objects.visible_to(researcher)
    close(study, None, NOW)
    assert session in TrainingSession.objects.visible_to(researcher)
    kinds = list(study.events.values_list("kind", flat=True))
    assert kinds.count("marked") == kinds.count("unmarked") == 1


def test_marks_go_to_those_only_who_can_have_them(world):
    study = running_study(world)
    people = world.people
    for person, task in (
        (people[Role.LEAD], Task.ASSESSOR),
        (people[Role.RESEARCHER], Task.ASSESSOR),
        (people[Role.PT], Task.INTERIM),
        (build_world("other").people[Role.PT], Task.ASSESSOR),
    ):
        with pytest.raises(InvalidSetting, match="another role"):
            give_mark(study, person, task, None, NOW)
    enrollment = enrolled(study, new_patient(world))
    session = start_session(enrollment, Place(), people[Role.PT], NOW)
    with pytest.raises(InvalidSetting, match="End it first"):
        give_mark(study, new_pt(world), Task.ASSESSOR, None, NOW)
    session.state = "finished"
    session.save()
    with pytest.raises(InvalidSetting, match="has treated"):
        give_mark(study, people[Role.PT], Task.ASSESSOR, None, NOW)


# --- revealing ------------------------------------------------------------------------------------


def test_revealing_an_arm_needs_a_reason_and_is_recorded(world):
    study = running_study(world)
    enrollment = enrolled(study, new_patient(world))
    pt = world.people[Role.PT]
    with pytest.raises(InvalidSetting, match="Say why"):
        reveal_arms(enrollment, " ", emergency=True, by=pt, now=NOW)
    [arm] = reveal_arms(enrollment, "a fall", emergency=True, by=pt, now=NOW)
    assert arm.code == enrollment.allocation.group
    event = study.events.last()
    assert (event.kind, event.by, event.reason) == ("emergency", pt, "a fall")


def test_who_assesses_cannot_reveal_and_the_attempt_is_recorded(world):
    study = running_study(world)
    assessor = new_pt(world)
    give_mark(study, assessor, Task.ASSESSOR, None, NOW)
    enrollment = enrolled(study, new_patient(world))
    with pytest.raises(UnblindingRefused, match="Ask a lead"):
        reveal_arms(enrollment, "curious", emergency=True, by=assessor, now=NOW)
    event = study.events.last()
    assert (event.kind, event.by) == ("refused", assessor)


# --- leaving --------------------------------------------------------------------------------------


def test_withdrawing_consent_to_research_leaves_the_study_as_was_agreed(world):
    study = running_study(world)
    kept, removed = new_patient(world, 1), new_patient(world, 2)
    both = [enrolled(study, kept), enrolled(study, removed, keep_data=False)]
    for patient, enrollment in zip((kept, removed), both, strict=True):
        session = start_session(enrollment, Place(), None, NOW)  # in mid-session
        withdraw_consent(patient, Purpose.RESEARCH, None, NOW)
        enrollment.refresh_from_db()
        patient.refresh_from_db()
        session.refresh_from_db()
        assert enrollment.withdrawn_at == NOW
        assert not patient.blinded
        assert session.state == "ready"
        with pytest.raises(InvalidSetting, match="has withdrawn"):
            start_session(enrollment, Place(), None, NOW)
    assert [enrollment.is_analyzed for enrollment in both] == [True, False]


def test_erasing_a_patient_leaves_numbers_and_no_way_back(world):
    study = running_study(world)
    patient = new_patient(world)
    enrollment = enrolled(study, patient)
    reveal_arms(
        enrollment, f"{patient.nickname} fell", emergency=True, by=world.people[Role.PT], now=NOW
    )
    erase(patient, ErasureReason.ASKED, None, NOW)
    enrollment.refresh_from_db()
    assert enrollment.code.startswith("E-")
    assert enrollment.withdrawn_at is not None
    assert enrollment.allocation.group in {"A", "B"}
    assert not study.events.filter(reason__contains="fell").exists()
    assert study.enrollments.count() == 1


def test_who_left_stands_on_no_board_before_the_study_is_closed(world):
    """A board of one feedback type tells the arm, also to those who assess."""
    study = running_study(world)
    patient = new_patient(world)
    patient.boards = "clinic"
    patient.save()
    record_consent(patient, Purpose.BOARDS, None, NOW, "clinic")
    enrollment = enrolled(study, patient)
    board = Leaderboard.everywhere.filter(clinic=world.clinic, among="clinic").get()
    withdraw(enrollment, None, NOW)
    assert not Patient.everywhere.get(pk=patient.pk).blinded  # the own page tells scores again
    assert patient not in eligible_patients(board)
    close(study, None, NOW)
    assert patient in eligible_patients(board)


def test_who_left_has_no_family_view_before_the_study_is_closed(world):
    """An assessor may have kept a link that was given before."""
    study = running_study(world)
    patient = new_patient(world)
    record_consent(patient, Purpose.FAMILY, None, NOW)
    token = give_link(patient, 4, world.people[Role.PT], "", NOW, shows_name=False)
    withdraw(enrolled(study, patient), None, NOW)
    assert find_link(token, NOW) is None
    close(study, None, NOW)
    assert find_link(token, NOW) is not None
