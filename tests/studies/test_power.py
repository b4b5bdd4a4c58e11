"""Power by simulation: found in the right share, stored with its seeds, gone on with."""

from __future__ import annotations

import os
import subprocess
import sys
from io import StringIO

import pytest
from django.core.management import CommandError, call_command
from django.urls import reverse

from rehab.management.commands import studypower
from rehab.people.roles import Role
from rehab.sessions.setup.protocol_models import Protocol
from rehab.studies.models import Arm
from rehab.studies.power_runs import PowerRun, plan_run, usual_settings, work
from rehab.studies.simulation.power import SimulatedDifference, summarize, wilson
from rehab.training.measures import InvalidSetting
from rehab.training.phases import make_phase
from tests.support.studies import draft_study
from tests.support.world import NOW, World, client_of

pytestmark = pytest.mark.django_db
SETTINGS = {
    "effects": {"A": 0.0, "B": 30.0},
    "participants": 12,
    "sd_percent": 5.0,
    "kept_percent": 25.0,
    "dropout_percent": 0.0,
}


def short_study(world: World, **settings):
    """Return a draft whose sessions are walked in a moment."""
    study = draft_study(world, visits=1, primary_outcome="improvement_over_baseline", **settings)
    protocol = Protocol.everywhere.create(clinic=world.clinic, name="short")
    for position, (kind, strides) in enumerate((("baseline", 54), ("training", 30)), start=1):
        feedback = make_phase(kind).feedback
        protocol.phases.create(
            position=position, kind=kind, name=kind, feedback=feedback, strides=strides
        )
    Arm.everywhere.filter(study=study).update(protocol=protocol)
    return study


def test_a_large_effect_is_found_and_its_size_is_what_was_put_in(world):
    run = plan_run(short_study(world), SETTINGS, 4, None, NOW)
    for stored in work(run):
        assert 0 < stored.done <= 4
    [pair] = PowerRun.everywhere.get(pk=run.pk).power
    assert (pair.group, pair.reference, pair.studies, pair.power) == ("B", "A", 4, 1.0)
    assert pair.estimate == pytest.approx(30, abs=5)
    assert pair.low < 1.0 <= pair.high


def test_what_is_stored_is_not_simulated_again_and_the_end_is_the_same(world):
    study = short_study(world)
    whole, broken = (plan_run(study, SETTINGS, 3, None, NOW) for _ in range(2))
    for _stored in work(whole):
        pass
    broken.found = {"1": [["B", "A", 99.0, 98.0, 100.0]]}  # marked, to be known again
    for _stored in work(broken):
        pass
    assert broken.found.pop("1") != whole.found.pop("1")
    assert broken.found == whole.found


def test_power_is_the_share_of_intervals_without_zero():
    found = [
        SimulatedDifference("B", "A", 2.0, 1.0, 3.0),
        SimulatedDifference("B", "A", -2.0, -3.0, -1.0),
        SimulatedDifference("B", "A", 0.0, -1.0, 1.0),
        SimulatedDifference("B", "A", 1.0, None, None),
    ]
    [pair] = summarize(found)
    assert pair.power == 0.5
    assert pair.estimate == pytest.approx(0.25)
    assert wilson(5, 10) == pytest.approx((0.2366, 0.7634), abs=1e-4)
    assert summarize([]) == []


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"effects": {}}, "Give an arm an effect"),
        ({"effects": {"B": 200.0}}, "at most 100 %"),
        ({"participants": 1}, "2 to 2000 participants"),
        ({"sd_percent": -1.0}, "differ by 0 to 100"),
        ({"kept_percent": 150.0}, "share from 0 to 1"),
        ({"dropout_percent": 100.0}, "below 1"),
    ],
)
def test_what_cannot_be_simulated_is_refused_with_the_cure(world, change, words):
    before = PowerRun.everywhere.count()
    with pytest.raises(InvalidSetting, match=words):
        plan_run(short_study(world), SETTINGS | change, 3, None, NOW)
    assert PowerRun.everywhere.count() == before


def test_a_phase_without_an_end_is_refused_and_not_walked_for_ever(world):
    study = short_study(world)
    study.arms.get(code="A").protocol.phases.update(strides=None, seconds=None)
    with pytest.raises(InvalidSetting, match="without an end"):
        plan_run(study, SETTINGS, 3, None, NOW)


def test_the_page_asks_shows_progress_and_refuses_with_words(world):
    study = short_study(world)
    lead, url = client_of(world, Role.LEAD), reverse("study-power", args=[study.pk])
    sent = {"participants": 8, "sd_percent": "5,0", "kept_percent": 25, "dropout_percent": 0}
    sent |= {"simulations": 3, "effect_A": 0, "effect_B": 0}
    assert "Give an arm an effect" in lead.post(url, sent).content.decode()
    assert lead.post(url, sent | {"effect_B": "12,5"}).status_code == 302
    run = study.power_runs.get()
    assert run.settings["effects"] == {"A": 0.0, "B": 12.5}
    run.found = {"0": [["B", "A", 12.0, 1.0, 23.0]]}
    run.save()
    page = lead.get(url).content.decode()
    assert "1 of 3 studies" in " ".join(page.split())
    assert 'value="1"' in page
    assert "Resume" in page  # no server runs here that would
    assert client_of(world, Role.PT).get(url).status_code == 403
    assert client_of(world, Role.RESEARCHER).get(url).status_code == 403  # of a draft
    go_on = reverse("power-run", args=[run.pk])
    assert lead.post(go_on)["Location"] == url


def test_the_command_plans_and_goes_on(world):
    study, out = short_study(world), StringIO()
    named = [study.code, "--clinic", world.clinic.name, "--effects", "A=0,B=60", "--sd", "5"]
    call_command("studypower", *named, "--participants", "8", "--simulations", "2", stdout=out)
    assert "B − A: power 100%" in out.getvalue()
    run = study.power_runs.get()
    run.simulations = 3
    run.save()
    call_command("studypower", "--run", str(run.pk), stdout=out)
    assert PowerRun.everywhere.get(pk=run.pk).is_done
    with pytest.raises(CommandError, match="Name one study"):
        call_command("studypower", "NONE", stdout=out)
    with pytest.raises(CommandError, match="no run 0"):
        call_command("studypower", "--run", "0", stdout=out)


# --- as a child of the server ---------------------------------------------------------------------


def test_a_child_that_is_done_ends_in_order_while_its_server_lives():
    code = (
        "import django, time; django.setup()\n"
        "from rehab.management.commands.studypower import live_with_parent\n"
        "live_with_parent()\n"
        "time.sleep(0.2)"  # so that the thread waits for its input
    )
    environment = os.environ | {"DJANGO_SETTINGS_MODULE": "garry_site.settings"}
    with subprocess.Popen(
        [sys.executable, "-c", code], stdin=subprocess.PIPE, env=environment
    ) as child:
        assert child.wait(60) == 0


def test_a_child_whose_study_cannot_be_simulated_notes_it_and_is_not_started_again(
    world, monkeypatch
):
    monkeypatch.setattr(studypower, "live_with_parent", lambda: None)
    run = plan_run(short_study(world), SETTINGS, 1, None, NOW)
    Protocol.everywhere.filter(name="short").first().phases.update(strides=None)
    call_command("studypower", run=run.pk, child=True, stdout=StringIO(), stderr=StringIO())
    run.refresh_from_db()
    assert "phase without an end" in run.trouble


@pytest.mark.parametrize(("better", "expected"), [(True, 2 / 3), (False, 1 / 3)])
def test_with_a_margin_power_is_to_find_that_nothing_is_worse_by_it(better, expected):
    ends = [(-1.0, 3.0), (0.5, 4.0), (-3.0, 1.0)]
    found = [SimulatedDifference("B", "A", (low + high) / 2, low, high) for low, high in ends]
    [pair] = summarize(found, 2.0, higher_is_better=better)
    assert pair.power == pytest.approx(expected)


def test_the_form_begins_with_the_plan_and_keeps_what_was_typed(world):
    study = short_study(world, planned_sd=8.0, assumed={"difference": 5.0, "dropout": 0.1})
    lead, url = client_of(world, Role.LEAD), reverse("study-power", args=[study.pk])
    page = lead.get(url)
    assert "Julious 2004" in page.content.decode()
    form = page.context["form"]
    assert form["sd_percent"].value() == 8.0
    assert form["effect_B"].value() == 5.0
    assert form["effect_A"].value() == 0.0
    assert form["dropout_percent"].value() == 10.0
    sent = {"participants": 8, "sd_percent": 6, "kept_percent": 30, "dropout_percent": 0}
    lead.post(url, sent | {"simulations": 3, "effect_A": 1, "effect_B": 20})
    form = lead.get(url).context["form"]
    typed = {**sent, "simulations": 3, "effect_A": 1, "effect_B": 20}
    assert {name: form[name].value() for name in typed} == typed


def test_an_outcome_without_feedback_keeps_a_part_of_what_training_adds(world):
    study = draft_study(world, planned_sd=5.0, assumed={"difference": 2.0})
    assumed = usual_settings(study)  # change in washout, of which a quarter is kept
    assert (assumed["sd_percent"], assumed["effects"]) == (20.0, {"B": 8.0})
    study.primary_outcome = "hit_rate"
    assumed = usual_settings(study)
    assert (assumed["sd_percent"], assumed["effects"]) == (10.0, {})


def test_a_run_says_how_people_differed_in_it(world):
    study = short_study(world, planned_sd=5.0)
    run = plan_run(study, SETTINGS, 4, None, NOW)
    for _stored in work(run):
        pass
    [pair] = PowerRun.everywhere.get(pk=run.pk).power
    assert pair.sd == pytest.approx(5, rel=0.4)  # of 12 people, and what strides scatter besides
    assert f"SD of {pair.sd:.3g}; planned were 5" in run.assumptions
