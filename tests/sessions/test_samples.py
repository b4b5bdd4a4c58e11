"""The data to try things with, which pages offer: what they are said to be, and still made so."""

from __future__ import annotations

import pytest
from django.contrib.staticfiles import finders
from django.urls import reverse

from rehab.people.models import Patient
from rehab.sessions.models import TrainingSession
from rehab.sessions.setup.recordings import check_upload, recordings_folder
from rehab.sources.recording import read_recording
from rehab.sources.recording.sample_recordings import is_sample
from rehab.stations.models import Station
from tests.support import samples
from tests.support.setup_form import choices

SIGNALS, STRIDES = samples.FOLDER / "signals.csv", samples.FOLDER / "strides.csv"
REAL = ["live", "recording walk.csv"]
OWN = ["synthetic good", "recording own-signals.csv", "recording own-strides.csv"]


def test_they_are_made_by_their_program(tmp_path):
    samples.write(tmp_path)
    assert (tmp_path / "strides.csv").read_text() == STRIDES.read_text()
    head = [file.read_text().splitlines()[0] for file in (tmp_path / "signals.csv", SIGNALS)]
    assert head[0] == head[1]


@pytest.mark.wide
@pytest.mark.django_db(transaction=True)
def test_every_column_of_the_signals_is_recognized_and_strides_count(tmp_path):
    stored, other = tmp_path / "stored.csv", tmp_path / "other.csv"
    other.write_text(SIGNALS.read_text().rstrip().rpartition("\n")[0])
    checked = check_upload([SIGNALS], None, save=stored)
    assert not checked.wrong
    assert is_sample(stored)  # nobody walked it under its new name either
    stored.unlink()
    assert not check_upload([other], None, save=stored).wrong
    assert not is_sample(stored)
    found = checked.found
    assert found["mass_kg"] == pytest.approx(75, abs=1)
    assert len(found["channels"]) == 6
    assert all(one["is_certain"] for one in found["channels"])
    assert found["valid"] > 0.9 * found["strides"] > 45


def test_the_strides_are_a_recording():
    recording = read_recording(STRIDES)
    assert len(recording.strides) == 80
    assert [phase.kind for phase in recording.phases] == ["baseline", "training"]


@pytest.mark.parametrize(
    ("name", "offered"), [("help", [SIGNALS, STRIDES]), ("check-recording", [SIGNALS])]
)
@pytest.mark.django_db
def test_pages_offer_what_they_read(world, name, offered):
    page = world.pt.get(reverse(name)).content.decode()
    assert page.count("samples/") == len(offered)
    for file in offered:
        assert f"samples/{file.name}" in page
        assert finders.find(f"samples/{file.name}")


@pytest.mark.parametrize("walked_by_nobody", [False, True])
@pytest.mark.parametrize("source", [*REAL, *OWN])
@pytest.mark.django_db
def test_what_nobody_walked_is_not_counted(world, settings, tmp_path, source, walked_by_nobody):
    """One rule over all sources: a simulated patient, and whatever GARRY made itself."""
    settings.DATA_DIR = tmp_path
    recordings_folder().mkdir()
    (recordings_folder() / "own-strides.csv").write_bytes(STRIDES.read_bytes())
    signals = recordings_folder() / "own-signals.csv"
    signals.write_text("time_s,left_force_n\n0,700\n")
    signals.with_name("own-signals.csv.simulated").touch()  # as it is stored after its check
    lines = STRIDES.read_text().splitlines()[:-1]
    (recordings_folder() / "walk.csv").write_text("\n".join(lines))
    patient = Patient.everywhere.create(
        clinic=world.clinic, code="S1", nickname="Joon", simulated=walked_by_nobody, body_mass_kg=75
    )
    station = Station.everywhere.create(clinic=world.clinic, name="Free")
    answers = choices(station, source=source, trained_side="left")
    page = world.pt.post(reverse("setup", args=[patient.pk]), answers)
    assert page.status_code == 302, page.context["form"].errors
    session = TrainingSession.everywhere.get(patient=patient)
    assert session.simulated == (walked_by_nobody or source not in REAL)
