"""The data to try things with, which pages offer: what they are said to be, and still made so."""

from __future__ import annotations

import pytest
from django.contrib.staticfiles import finders
from django.urls import reverse

from rehab.sessions.setup.recordings import check_upload
from rehab.sources.recording import read_recording
from tests.support import samples

SIGNALS, STRIDES = samples.FOLDER / "signals.csv", samples.FOLDER / "strides.csv"


def test_they_are_made_by_their_program(tmp_path):
    samples.write(tmp_path)
    assert (tmp_path / "strides.csv").read_text() == STRIDES.read_text()
    head = [file.read_text().splitlines()[0] for file in (tmp_path / "signals.csv", SIGNALS)]
    assert head[0] == head[1]


@pytest.mark.wide
@pytest.mark.django_db(transaction=True)
def test_every_column_of_the_signals_is_recognized_and_strides_count():
    checked = check_upload([SIGNALS], None)
    assert not checked.wrong
    found = checked.found
    assert found["mass_kg"] == pytest.approx(75, abs=1)
    assert len(found["channels"]) == 6
    assert all(one["is_certain"] for one in found["channels"])
    assert found["valid"] > 0.9 * found["strides"] > 45


def test_the_strides_are_a_recording():
    recording = read_recording(STRIDES)
    assert len(recording.strides) == 80
    assert [phase.kind for phase in recording.phases] == ["baseline", "training"]


@pytest.mark.parametrize("name", ["help", "check-recording"])
@pytest.mark.django_db
def test_pages_offer_them(world, name):
    page = world.pt.get(reverse(name)).content.decode()
    for file in (SIGNALS, STRIDES):
        assert f"samples/{file.name}" in page
        assert finders.find(f"samples/{file.name}")
