"""The number of participants by formula: published sizes, what is out of bounds, what is said."""

from __future__ import annotations

import pytest
from django.urls import reverse
from scipy import stats

from rehab.people.roles import Role
from rehab.studies.analysis.sample_size import Assumed, power_of, size_of
from rehab.studies.registration.lifecycle import register
from rehab.studies.registration.protocol_pdf import write_pdf
from rehab.studies.registration.size import size_of_document, size_of_study
from rehab.training.measures import InvalidSetting
from tests.support.studies import draft_study
from tests.support.world import NOW, client_of


def half(**changes: float) -> Assumed:
    """Return half a standard deviation between arms, from which nobody leaves."""
    return Assumed(**{"difference": 5.0, "sd": 10.0, "dropout": 0.0} | changes)


@pytest.mark.parametrize(
    ("changes", "weights", "walked", "finish"),
    [
        # G*Power 3.1: 394, 64, 26 and (power 90 %) 86 in each of two groups; so Cohen 1988, 2.4.1.
        ({"difference": 2.0}, (1, 1), 1, 2 * 394),
        ({}, (1, 1), 1, 2 * 64),
        ({"difference": -8.0}, (1, 1), 1, 2 * 26),
        ({"power": 0.9}, (1, 1), 1, 2 * 86),
        ({}, (1, 2), 1, 144),  # G*Power 3.1: 48 and 96
        # Within people, whose two outcomes correlate by 0.5, so that differences have the same SD:
        # 34 (G*Power 3.1); by 0.8 they are 0.79 SD apart: 15, in two orders 16.
        ({}, (1, 1), 2, 34),
        ({"correlation": 0.8}, (1, 1), 2, 16),
        ({}, (1, 1, 1), 1, 3 * 86),  # each of three pairs at 0.05 / 3
    ],
)
def test_sizes_are_those_that_are_published(changes, weights, walked, finish):
    assert size_of(half(**changes), weights, walked=walked).finish == finish


def test_who_leaves_is_enrolled_besides_in_whole_blocks():
    size = size_of(half(dropout=0.1), (1, 1))
    assert (size.finish, size.enrolled) == (128, 144)  # 142.2 and even
    assert size_of(half(dropout=0.0), (1, 1)).enrolled == 128


def test_power_is_that_of_the_noncentral_t():
    assert power_of(1e-9, 1.0, 40) == pytest.approx(0.05, abs=1e-6)
    for freedom, shift, alpha in ((5, 1.0, 0.05), (170, 3.28, 0.05 / 3)):
        bound = stats.t.isf(alpha / 2, freedom)
        expected = stats.nct.sf(bound, freedom, shift) + stats.nct.cdf(-bound, freedom, shift)
        assert power_of(-shift, 1.0, freedom, alpha) == pytest.approx(expected, abs=1e-9)


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"difference": 0.0}, "above 0"),
        ({"sd": 0.0}, "above 0"),
        ({"power": 0.3}, "50 to 99"),
        ({"dropout": 0.95}, "0 to 90"),
        ({"correlation": 1.0}, "0 to 0.99"),
        ({"difference": 0.01}, "More than"),
    ],
)
def test_what_has_no_size_is_refused_with_the_cure(changes, words):
    with pytest.raises(InvalidSetting, match=words):
        size_of(half(**changes), (1, 1))


@pytest.mark.django_db
def test_a_studys_own_assumptions_are_told_with_their_source(world):
    study = draft_study(world, planned_sd=10.0, assumed={"difference": 5.0, "dropout": 0.1})
    size, told = size_of_study(study)
    assert (size.finish, size.enrolled) == (128, 144)
    for words in ("128 participants", "144", "Julious 2004", "SD of 10 "):
        assert words in told
    register(study, None, NOW)
    assert size_of_document(study.versions.get().document) == told
    assert b"128 participants" in write_pdf(study)
    study.margin = 8.0  # which is then what has to be found
    assert size_of_study(study)[0].enrolled < 80
    study.planned_sd = None
    assert size_of_study(study) is None


@pytest.mark.django_db
def test_the_plan_answers_while_it_is_typed(world):
    lead, url = client_of(world, Role.LEAD), reverse("study-size")
    sent = {"difference": "5,0", "planned_sd": "10", "power_percent": "80", "dropout_percent": "10"}
    sent |= {"correlation": "0.5", "arm-0-name": "x", "arm-1-name": "y"}
    answer = lead.post(url, sent).json()
    assert answer["participants"] == 144
    assert "128 participants" in answer["words"]
    assert lead.post(url, sent | {"crossover": "on"}).json()["participants"] == 38
    assert lead.post(url, sent | {"arm-2-name": "z"}).json()["participants"] > 250
    assert lead.post(url, sent | {"planned_sd": ""}).json() == {"words": "", "participants": None}
    refused = lead.post(url, sent | {"power_percent": "5"}).json()
    assert "50 to 99" in refused["words"]
    assert client_of(world, Role.PT).post(url, sent).status_code == 403
