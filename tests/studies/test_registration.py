"""A study is fixed before its first patient, and every later change is a version of its own."""

from __future__ import annotations

from dataclasses import replace

import pytest
from django.db import IntegrityError, transaction

from rehab.feedback.models import FeedbackBand, FeedbackType
from rehab.people.roles import Role
from rehab.sessions.models import TrainingSession
from rehab.sessions.questionnaires import Questionnaire
from rehab.sessions.services import SessionRequest, create_session
from rehab.sessions.setup.default_protocols import install_defaults
from rehab.sessions.setup.protocol_models import MeasureDefinition, Protocol, ProtocolPhase
from rehab.studies.allocation.scheme import Secret
from rehab.studies.blinding import take_mark
from rehab.studies.models import StudyMark, StudyState
from rehab.studies.participants import Allocation
from rehab.studies.registration.allocation_secret import seal, unseal
from rehab.studies.registration.document import describe, digest_of
from rehab.studies.registration.lifecycle import close, current_version, register, revise, start
from rehab.studies.visits import Place, seed_of, start_session
from rehab.training.goals import GoalRule
from rehab.training.measures import MEASURES, WORN_CHANNELS, InvalidSetting
from tests.support.studies import SEED, draft_study, enrolled, new_patient, running_study
from tests.support.world import NOW, World

pytestmark = pytest.mark.django_db


def kinds(study) -> list[str]:
    return list(study.events.values_list("kind", flat=True))


def test_registering_fixes_the_plan_and_publishes_a_commitment_alone(world):
    study = draft_study(world)
    version = register(study, world.people[Role.LEAD], NOW)
    study.refresh_from_db()
    assert study.state == StudyState.REGISTERED
    assert version.document["allocation"]["commitment_sha256"] == study.commitment
    assert unseal(study.sealed).commitment == study.commitment
    assert version.digest == digest_of(version.document)
    assert [arm["feedback_type"] for arm in version.document["arms"]] == ["positive", "negative"]
    assert version.document["arms"][0]["phases"][0]["kind"] == "baseline"
    assert SEED not in str(version.document) + study.sealed
    with pytest.raises(InvalidSetting, match="is registered"):
        register(study, None, NOW)


@pytest.mark.parametrize(
    ("change", "cure"),
    [
        ({"sealed": Secret(SEED, (3,))}, "Use multiples of 2"),
        ({"sealed": Secret("short", (2,))}, "at least 8"),
        ({"method": "list"}, "Paste the list"),
        ({"method": "minimization"}, "at least one"),
        ({"visits": 0}, "1 to 60"),
    ],
)
def test_a_study_that_could_not_be_run_is_not_registered(world, change, cure):
    change = {k: seal(v) if isinstance(v, Secret) else v for k, v in change.items()}
    study = draft_study(world, **change)
    with pytest.raises(InvalidSetting, match=cure):
        register(study, None, NOW)
    study.refresh_from_db()
    assert study.is_draft
    assert kinds(study) == []


def test_arms_that_could_not_be_walked_are_refused(world):
    study = draft_study(world)
    without = Protocol.everywhere.get(clinic=None, name="Training only")
    study.arms.filter(code="B").update(protocol=without)
    with pytest.raises(InvalidSetting, match="needs a baseline phase"):
        register(study, None, NOW)
    study.arms.all().update(protocol=study.arms.first().protocol, valence="positive")
    with pytest.raises(InvalidSetting, match="Arms A and B do the same"):
        register(study, None, NOW)


def test_a_seal_opens_with_the_servers_own_key_only(world, settings):
    sealed = seal(Secret(SEED, (2,)))
    settings.SECRET_KEY = "another key than that of before, long enough"
    with pytest.raises(InvalidSetting, match="GARRY_SECRET_KEY"):
        unseal(sealed)


def test_an_arm_whose_protocol_was_deleted_says_so(world):
    study = draft_study(world)
    own_protocol(world, study)
    register(study, None, NOW)
    Protocol.everywhere.get(name="Of the study").delete()
    with pytest.raises(InvalidSetting, match="protocol of arm A was deleted"):
        current_version(study)


def own_protocol(world: World, study) -> ProtocolPhase:
    protocol = Protocol.everywhere.create(clinic=world.clinic, name="Of the study")
    for position, kind in enumerate(("baseline", "training", "washout")):
        ProtocolPhase.everywhere.create(
            protocol=protocol,
            position=position,
            kind=kind,
            name=kind,
            feedback=kind == "training",
            strides=60,
        )
    study.arms.all().update(protocol=protocol)
    return protocol.phases.get(kind="training")


def test_a_protocol_that_is_changed_after_the_start_needs_a_new_version(world):
    study = draft_study(world)
    training = own_protocol(world, study)
    register(study, None, NOW)
    start(study, None, NOW)
    first = enrolled(study, new_patient(world, 1))
    before = start_session(first, Place(), None, NOW)
    training.strides = 90
    training.save()
    newcomer = new_patient(world, 2)
    with pytest.raises(InvalidSetting, match="new version"):
        enrolled(study, newcomer)
    with pytest.raises(InvalidSetting, match="Say why"):
        revise(study, " ", None, NOW)
    revise(study, "Ninety strides are needed to learn.", None, NOW)
    second = enrolled(study, newcomer)
    after = start_session(second, Place(), None, NOW)
    numbers = [visit.version.number for visit in (before.study_visit, after.study_visit)]
    assert numbers == [1, 2]
    phases = [
        version.document["arms"][0]["phases"][1]["strides"] for version in study.versions.all()
    ]
    assert phases == [60, 90]
    with pytest.raises(InvalidSetting, match="Nothing is different"):
        revise(study, "again", None, NOW)


def edit_feedback(world: World, slug: str) -> None:
    FeedbackType.everywhere.filter(clinic=world.clinic).delete()
    edited = FeedbackType.everywhere.create(clinic=world.clinic, slug=slug)
    for percent in (0, 100):
        edited.bands.create(from_percent=percent, words={"en": f"from {percent}"})


def edit_phase(**changes):
    return lambda study, phase: ProtocolPhase.everywhere.filter(pk=phase.pk).update(**changes)


def edit_measure(study, _phase) -> None:
    MeasureDefinition.everywhere.filter(clinic=study.clinic).update(value_max=9.0)


def edit_words(study, _phase) -> None:
    FeedbackBand.everywhere.filter(feedback_type__clinic=study.clinic).update(words={"de": "Toll"})


@pytest.mark.parametrize(
    "edit",
    [
        edit_phase(goal_percent=110),
        edit_phase(robot=False),
        edit_phase(rest_s=60),
        edit_phase(gain=0.85),
        edit_measure,
        edit_words,
    ],
    ids=("goal", "robot", "rest", "gain", "measure", "words"),
)
def test_nothing_that_decides_what_is_walked_changes_unseen(world, edit):
    study = draft_study(world)
    training = own_protocol(world, study)
    own = MeasureDefinition.everywhere.create(
        clinic=world.clinic,
        slug="speed",
        unit="m/s",
        value_min=0,
        value_max=10,
        goal_min=0,
        goal_max=5,
    )
    study.arms.all().update(measure=own)
    edit_feedback(world, "positive")
    register(study, None, NOW)
    assert current_version(study).number == 1
    edit(study, training)
    with pytest.raises(InvalidSetting, match="has been changed since"):
        current_version(study)


@pytest.mark.parametrize("slug", ["a2", "step_length"])
def test_a_measure_corrected_in_code_changes_neither_what_is_registered_nor_what_was_walked(
    world, slug, monkeypatch
):
    study = draft_study(world)
    study.arms.all().update(measure=MeasureDefinition.everywhere.get(clinic=None, slug=slug))
    lead = world.people[Role.LEAD]
    register(study, lead, NOW)
    start(study, lead, NOW)
    walked = start_session(enrolled(study, new_patient(world)), Place(), None, NOW)
    corrected = replace(MEASURES[slug], value_max=7.0, goal_max=6.0)
    monkeypatch.setitem(MEASURES._own, slug, corrected)
    install_defaults()
    row = MeasureDefinition.everywhere.get(clinic=None, slug=slug)

    assert row.to_rule() == corrected
    later = start_session(enrolled(study, new_patient(world, 2)), Place(), None, NOW)
    assert later.to_plan().measure == walked.to_plan().measure != corrected
    assert TrainingSession.everywhere.get(pk=walked.pk).to_plan() == walked.to_plan()
    assert current_version(study).number == 1
    care = create_session(
        SessionRequest(
            patient=new_patient(world, 3, consents=False),
            valence="positive",
            measure=row,
            protocol=study.arms.first().protocol,
            goal=GoalRule(value=0.5),
        )
    )
    assert care.to_plan().measure == corrected


def test_a_study_without_what_came_later_has_the_document_that_it_always_had(world):
    FeedbackType.everywhere.filter(clinic=world.clinic).delete()
    [arm, _other] = describe(draft_study(world))["arms"]
    assert set(arm) == {
        *("code", "name", "weight", "feedback_type", "gain", "robot_intensity"),
        *("measure", "protocol", "phases"),
    }
    assert {frozenset(phase) for phase in arm["phases"]} == {
        frozenset(("kind", "name", "feedback", "gain", "strides", "seconds"))
    }


def test_what_was_allocated_cannot_be_allocated_otherwise(world):
    study = running_study(world)
    study.arms.filter(code="A").update(weight=2)
    with pytest.raises(InvalidSetting, match="plan a new one"):
        revise(study, "more of A", None, NOW)
    study.arms.filter(code="A").update(weight=1)
    study.method, study.factors = "minimization", [["severity", ["mild", "severe"]]]
    with pytest.raises(InvalidSetting, match="plan a new one"):
        revise(study, "balance", None, NOW)
    study.refresh_from_db()
    assert current_version(study).number == 1


def test_closing_waits_for_open_sessions_and_ends_what_was_hidden(world):
    study = running_study(world)
    patient = new_patient(world)
    session = start_session(enrolled(study, patient), Place(), None, NOW)
    with pytest.raises(InvalidSetting, match="End it first"):
        close(study, None, NOW)
    session.state = "finished"
    session.save()
    close(study, world.people[Role.LEAD], NOW)
    patient.refresh_from_db()
    assert not patient.blinded
    assert kinds(study) == ["registered", "started", "enrolled", "closed"]
    with pytest.raises(InvalidSetting, match="Only a running study"):
        enrolled(study, new_patient(world, 2))


@pytest.mark.parametrize(
    ("rows", "changes"),
    [
        ("versions", {"document": {}}),
        ("events", {"reason": "otherwise"}),
        ("events", {"kind": "closed"}),
        ("marks", {"task": "assessor"}),
        ("allocations", {"group": "B"}),
    ],
)
def test_what_happened_in_a_study_is_only_added(rows, changes, world):
    study = running_study(world)
    enrollment = enrolled(study, new_patient(world))
    StudyMark.everywhere.create(study=study, user=world.people[Role.PT], task="interim")
    stored = Allocation.everywhere.filter(enrollment=enrollment)
    stored = stored if rows == "allocations" else getattr(study, rows).all()
    for attempt in (lambda: stored.update(**changes), lambda: stored._raw_delete("default")):
        with pytest.raises(IntegrityError, match="append-only"), transaction.atomic():
            attempt()


def test_a_mark_ends_once(world):
    study = running_study(world)
    StudyMark.everywhere.create(study=study, user=world.people[Role.PT], task="interim")
    take_mark(study.marks.get(), None, NOW)
    with pytest.raises(IntegrityError, match="append-only"), transaction.atomic():
        study.marks.update(ended_at=None)


def test_a_study_warns_of_negative_feedback_early_after_a_stroke(world):
    study = draft_study(world, months_since_stroke=None)
    assert study.risks_early_punishment
    study.months_since_stroke = 5
    assert study.risks_early_punishment
    study.months_since_stroke = 6
    assert not study.risks_early_punishment
    study.months_since_stroke = None
    study.arms.all().update(valence="positive")
    assert not study.risks_early_punishment


def test_a_commitment_depends_on_every_part_of_the_secret():
    secret = Secret(SEED, (2, 4))
    assert secret.commitment != replace(secret, block_sizes=(2,)).commitment


def test_what_is_asked_is_registered_and_changed_questions_need_a_new_version(world):
    study, own = draft_study(world), world.rows[Questionnaire]
    protocol = own_protocol(world, study).protocol
    protocol.questionnaires = ["sus", own.slug]
    protocol.save()
    version = register(study, None, NOW)
    asked = version.document["arms"][0]["questionnaires"]
    assert [row["title"] for row in asked] == ["System Usability Scale (SUS)", own.name]
    assert current_version(study) == version
    Questionnaire.everywhere.filter(pk=own.pk).update(items="Hungry? | no | very | 5")
    with pytest.raises(InvalidSetting, match="new version"):
        current_version(study)


def test_the_robot_s_variants_follow_from_one_seed_for_all_participants_at_a_visit(world):
    study = running_study(world)
    plans = [
        start_session(enrolled(study, new_patient(world, number)), Place(), None, NOW).plan
        for number in (1, 2)
    ]
    assert plans[0]["seed"] == plans[1]["seed"] == seed_of(study.pk, 1)
    assert seed_of(study.pk, 2) != seed_of(study.pk, 1)


def test_a_follow_up_is_registered_planned_and_walked_without_feedback(world):
    study = running_study(world, visits=1, follow_up_days=30)
    assert study.versions.get().document["visits"]["days_to_follow_up"] == 30
    enrollment = enrolled(study, new_patient(world))
    first, later = enrollment.visits.all()
    assert (later.day - first.day).days == 30
    kinds = []
    for _visit in (first, later):
        session = start_session(enrollment, Place(), None, NOW)
        kinds.append([phase["kind"] for phase in session.plan["phases"]])
        TrainingSession.everywhere.filter(pk=session.pk).update(state="finished")
    assert kinds == [["baseline", "training", "washout"], ["baseline"]]


@pytest.mark.parametrize(
    ("plan", "arm", "cure"),
    [
        ({"primary_outcome": "follow_up_change"}, {}, "give the days to it"),
        ({"secondary_outcomes": ["10mwt_follow_up"]}, {}, "give the days to it"),
        ({"secondary_outcomes": ["tlx"]}, {}, "does not ask it"),
        ({"secondary_outcomes": ["savings"], "visits": 1}, {}, "plan more of them"),
        ({"primary_outcome": "catch_change"}, {}, "choose another protocol or outcome"),
        ({"secondary_outcomes": ["score"]}, {}, "Choose an outcome that is measured"),
        ({"primary_outcome": "hit_rate", "secondary_outcomes": ["points_per_100_steps"]},
         {"valence": "explicit"}, "Choose an outcome that is measured"),
        ({}, {"measure": None}, "choose the same measure"),
    ],
)  # fmt: skip
def test_an_outcome_that_the_plan_cannot_give_or_compare_is_not_registered(world, plan, arm, cure):
    study = draft_study(world, **plan)
    if "measure" in arm:
        others = MeasureDefinition.everywhere.exclude(channel__in=WORN_CHANNELS)
        arm = {"measure": others.exclude(slug="a2").first()}
    study.arms.filter(code="B").update(**arm)
    with pytest.raises(InvalidSetting, match=cure):
        register(study, None, NOW)


def test_what_a_plan_can_give_is_registered_and_later_checked_again(world):
    study = draft_study(
        world,
        primary_outcome="follow_up_change",
        secondary_outcomes=["savings", "after_effect"],
        follow_up_days=30,
    )
    register(study, None, NOW)
    study.follow_up_days = None
    with pytest.raises(InvalidSetting, match="give the days to it"):
        revise(study, "No time", None, NOW)
    study.refresh_from_db()
    assert (study.follow_up_days, study.versions.count()) == (30, 1)
